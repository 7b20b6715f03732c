"""The command line as a user meets it: help, statuses, one sentence on stderr, no half-written folder."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from commands import here

from ident.errors import FitFailedError, IdentError
from ident.output import staged
from modelgen.errors import ModelgenError
from modelgen.manifest import MANIFEST


def ident(*arguments, cwd=None, **options):
    command = [sys.executable, "-m", "ident.command_line.cli", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=120, **options)


@pytest.mark.parametrize("command", ["fit", "diagnose", "simulate", "demo"])
def test_every_command_teaches_with_an_example(command):
    done = ident(command, "--help")
    assert done.returncode == 0
    assert f"Example: ident {command}" in " ".join(done.stdout.split())


def test_version_names_the_package():
    assert ident("--version").stdout.startswith("dynident ")


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from ident.command_line.cli import run; run(['--help']);"
        "heavy = {'numpy', 'scipy', 'sympy', 'casadi', 'matplotlib', 'pydantic'} & set(sys.modules);"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("arguments", "offender"),
    [
        (["fit"], "STUDY"),
        (["fit", "study.yaml"], "output"),
        (["fit", "nowhere.yaml", "-o", "out"], "nowhere.yaml"),
        (["fit", "study.yaml", "-o", ""], "-o is empty; name a folder"),
        (["diagnose", "study.yaml", "-o", " "], "-o is empty; name a folder"),
        (["fit", "study.yaml", "-o", "out", "--colour"], "--colour"),
        (["fot"], "fot"),
        (["diagnose", "nowhere.yaml", "-o", "out"], "nowhere.yaml"),
        (["simulate", "nobody", "-o", "out"], "nobody"),
        (["simulate", "ur10e", "-o", "out", "--effect", "gremlins:2"], "gremlins"),
        (["simulate", "ur10e", "-o", "out", "--effect", "spring:9"], "9"),
        (["simulate", "ur10e", "-o", "out", "--model", "E"], "E"),
    ],
)
def test_wrong_input_is_one_sentence_and_status_2(arguments, offender, tmp_path):
    done = here(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert offender in done.stderr
    assert done.stderr.startswith("ident: ") and done.stderr.count("\n") == 1
    assert done.stdout == "" and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (IdentError("a sentence"), 2),
        (ModelgenError("a sentence\nover two lines"), 2),
        (FitFailedError("a reason"), 1),
        (MemoryError("92 TiB"), 2),
        (KeyboardInterrupt(), 130),
    ],
)
def test_errors_become_exit_statuses(error, status, monkeypatch, capsys):
    import ident as door
    from ident.command_line import cli

    def fail(*_):
        raise error

    monkeypatch.setattr(door, "load", fail)
    assert cli.run(["fit", "study.yaml", "-o", "out"]) == status
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_our_own_mistakes_are_not_hidden(monkeypatch):
    import ident as door
    from ident.command_line import cli

    def fail(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(door, "load", fail)
    with pytest.raises(ZeroDivisionError):
        cli.run(["fit", "study.yaml", "-o", "out"])


def test_a_stopped_run_leaves_the_folder_as_it_was(tmp_path):
    folder = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt), staged(folder) as stage:
        (stage / "fit.json").write_text("{")
        raise KeyboardInterrupt
    assert not folder.exists()
    with staged(folder) as stage:
        (stage / "plots").mkdir()
        (stage / "plots" / "a.png").write_text("a")
        (stage / "fit.json").write_text("{}")
    assert sorted(path.name for path in folder.rglob("*")) == ["a.png", "fit.json", "plots", MANIFEST]
    with pytest.raises(KeyboardInterrupt), staged(folder) as stage:
        (stage / "fit.json").write_text("[")
        raise KeyboardInterrupt
    assert (folder / "fit.json").read_text() == "{}"
    assert sorted(path.name for path in folder.iterdir()) == ["fit.json", "plots", MANIFEST]


def test_a_command_without_a_folder_takes_its_own(monkeypatch):
    """`ident demo` alone, as `make demo` calls it: the parser of -o sees the default too."""
    from ident.command_line import cli

    seen = []

    def stop(folder, *_, **__):
        seen.append(folder)
        raise IdentError("seen")

    monkeypatch.setattr("ident.output.staged", stop)
    cli.run(["demo"])
    assert seen == [Path("out-demo")]


def test_a_folder_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "out").write_text("")
    done = ident("simulate", "ur10e", "-o", "out", cwd=tmp_path)
    assert done.returncode == 2 and "it is a file" in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_control_c_is_status_130_and_leaves_nothing(tmp_path):
    command = [sys.executable, "-m", "ident.command_line.cli", "simulate", "kuka_lwr4p", "-o", "out", "-v"]

    def listen() -> None:  # a shell's background jobs inherit that the signal is ignored
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, preexec_fn=listen
    ) as process:
        process.stderr.readline()  # it has begun
        process.send_signal(signal.SIGINT)
        rest = process.stderr.read()
        assert process.wait(timeout=60) == 130, rest
    assert "Traceback" not in rest
    assert list(tmp_path.iterdir()) == []


def test_completion_offers_robots_and_effects():
    from modelgen.command_line import effect_names, model_names, robot_names

    assert "kuka_lwr4p" in robot_names("kuka") and "ur10e" in robot_names("ur")
    assert "stribeck_friction" in effect_names("str")
    assert [name for name, _ in model_names("")] == ["A", "B", "C", "D"]
