"""The commands end to end on a small arm: the files they write, what they print, a pipe and a terminal."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import browser
import pytest
from commands import here
from small_arm import ARM

import ident as door
from benchmarks.child import measured
from ident.export.saved import load_fit
from ident.twin import PlannedRun, simulate, write_simulation
from tests.reliability.kills import TABLE

RUNS = (
    PlannedRun("first", "identify", 20.0),
    PlannedRun("second", "validate", 20.0),
    PlannedRun("third", "test", 20.0),
)


WIND = """
from modelgen.effects import SIGNALS, Effect, LinearParameter


class Wind(Effect):
    name, summary, signature, source = "wind", "air drags at the link", "grows with the rate", "Newton 1687"
    terms = {"Fw": SIGNALS.dq**5}
    linear = (LinearParameter("Fw", "N m s^5/rad^5", 0.0, 50.0),)
    typical = {"Fw": 1.0}
"""


def ident(*arguments, **options):
    command = [sys.executable, "-m", "ident.command_line.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("small")
    (folder / "small.yaml").write_text(ARM)
    made = simulate(folder / "small.yaml", "C", ("stribeck_friction:2",), seed=1, runs=RUNS)
    return write_simulation(made, folder / "twin")


@pytest.fixture(scope="module")
def fitted(study, tmp_path_factory):
    """The folder of a fit, and what the command said."""
    folder = tmp_path_factory.mktemp("fitted") / "out"
    done = ident("fit", study, "-o", folder)
    assert done.returncode == 0, done.stderr
    return folder, done


def test_fit_writes_what_the_contract_says_and_is_quiet_in_a_pipe(fitted):
    folder, done = fitted
    document = json.loads((folder / "fit.json").read_text())
    assert {"robot", "model", "base_parameters", "essential_parameters", "parameters",
            "relative_error_percent", "tests"} <= set(document)  # fmt: skip
    assert set(document["relative_error_percent"]) == {"identify", "validate", "test"}
    assert (folder / "parameters.csv").is_file() and list((folder / "plots").glob("*.svg"))
    html = (folder / "report.html").read_text(encoding="utf-8")
    assert "base parameters explain the torque" in html and len(html) < 8e6
    assert all(line.startswith("warning: ") for line in done.stderr.splitlines())
    assert "\x1b" not in done.stdout and done.stdout.splitlines()[0].startswith("parameter\t")
    assert sorted(p.name for p in folder.iterdir() if p.name.startswith(".")) == []


def test_fit_ends_by_what_is_left_and_begins_with_what_was_found(study, fitted):
    folder, done = fitted
    lines = done.stdout.splitlines()
    assert lines[-2].startswith("What is left: ") and "ident diagnose looks for" in lines[-2]
    assert lines[-1] == f"wrote {folder / 'report.html'}; next: ident diagnose {study} -o RESULTS"
    assert next(iter(json.loads((folder / "fit.json").read_text()))) == "checks"


def test_simulate_takes_duration_rate_and_noise_and_no_folder_of_somebody_else(study, tmp_path):
    robot = study.parent / "small.yaml"
    options = ["--duration", 6, "--rate", 100, "--noise", 0, "--seed", 3, "-o", tmp_path / "twin"]
    done = here("simulate", robot, *options)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1].split("\t") == ["run1.parquet", "identify", "", "6", "601"]
    before = {p.name: p.read_bytes() for p in (tmp_path / "twin").iterdir()}
    assert ident("simulate", robot, *options).returncode == 0  # the same seed writes the same files
    assert {p.name: p.read_bytes() for p in (tmp_path / "twin").iterdir()} == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "run1.parquet").write_text("an hour of recording")
    done = here("simulate", robot, *options[:-1], tmp_path / "mine")
    assert done.returncode == 2 and "run1.parquet, which was not written" in done.stderr
    done = here("simulate", robot, *options[:-1], robot.parent, "--overwrite")
    assert done.returncode == 2 and "small.yaml is an input of this command" in done.stderr
    assert robot.read_text() == ARM
    done = here("simulate", robot, "-o", tmp_path / "x", "--rate", 1)
    assert done.returncode == 2 and "rate_hz is 1; give 20 to 20000 Hz" in done.stderr


def test_an_effect_of_the_user_s_own_is_hidden_in_a_twin(tmp_path):
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "wind.py").write_text(WIND)
    few = ["--duration", "5", "--rate", "100", "-o", "twin"]
    arguments = ["simulate", "scara", "--effect", "wind:1", *few]
    assert "no effect is called 'wind'" in here(*arguments, cwd=tmp_path).stderr
    done = ident(*arguments, "--effects-folder", "own", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (hidden,) = json.loads((tmp_path / "twin" / "truth.json").read_text())["effects"]
    assert (hidden["effect"], hidden["joints"]) == ("wind", [1]) and hidden["parameters"]["Fw"] > 0


def test_robot_writes_a_robot_file_once(study, tmp_path):
    robot = study.parent / "small.yaml"
    done = here("robot", robot, "-o", tmp_path / "again.yaml")
    assert done.returncode == 0, done.stderr
    assert here("simulate", tmp_path / "again.yaml", "--duration", 5, "-o", tmp_path / "twin").returncode == 0
    for target in (tmp_path / "again.yaml", robot):
        done = here("robot", robot, "-o", target)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert robot.read_text() == ARM


def the_disk_is_full(arguments, out):
    """Run a command that wrote `out` before: it says one sentence, and what was there is whole."""

    def full() -> None:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))

    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    done = ident(*arguments, preexec_fn=full)
    assert done.returncode == 2 and "make room, or name another folder with -o" in done.stderr
    errors = [line for line in done.stderr.splitlines() if line.startswith("ident: ")]
    assert len(errors) == 1 and "Traceback" not in done.stderr
    assert before and {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before


posix = pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")


@pytest.mark.first_case
@posix
@pytest.mark.parametrize("command", ["fit", "simulate"])
def test_a_full_disk_is_one_sentence_and_the_old_result_stays(study, fitted, command):
    folder = fitted[0] if command == "fit" else fitted[0].parent / "twin"
    robot = [study.parent / "small.yaml", "--duration", 20] if command == "simulate" else [study]
    arguments = [command, *robot, "-o", folder]
    assert command == "fit" or ident(*arguments).returncode == 0
    the_disk_is_full(arguments, folder)


def test_fit_of_several_models_compares_them(study, tmp_path):
    done = ident("fit", study, "--models", "a,B", "-o", tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "A" / "fit.json").is_file() and (tmp_path / "B" / "report.html").is_file()
    assert "Comparison of models" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert (tmp_path / "comparison.csv").read_text().startswith("parameter,A value,A % std,B value")
    wrong = here("fit", study, "--models", "A,E", "-o", tmp_path / "wrong")
    assert wrong.returncode == 2 and "E" in wrong.stderr and not (tmp_path / "wrong").exists()


@pytest.fixture(scope="module")
def diagnosed(study, tmp_path_factory):
    """The folder of a diagnosis, and what the command said."""
    folder = tmp_path_factory.mktemp("diagnosed") / "out"
    done = ident("diagnose", study, "-o", folder, "-v")
    assert done.returncode == 0, done.stderr
    return folder, done


def test_diagnose_writes_what_the_contract_says(diagnosed):
    folder, done = diagnosed
    document = json.loads((folder / "diagnosis.json").read_text())
    assert {"verdict", "findings", "unexplained", "error_percent", "noise_floor_percent"} <= set(document)
    (first,) = document["findings"]
    assert (first["effect"], first["joints"], first["grade"]) == ("stribeck_friction", [2], "established")
    assert first["remedy"] and first["evidence"]["log_e"] > document["judged"]["log_e_asked"]
    assert document["judged"]["recordings"] == ["second"]
    assert 0 < first["evidence"]["blocks_for"] <= first["evidence"]["blocks"]
    assert "The model lacks stribeck friction on joint 2" in done.stdout
    assert f"What to do: {first['remedy']}." in done.stdout
    assert " s  " in done.stderr  # -v: each step with its time
    html = (folder / "report.html").read_text(encoding="utf-8")
    assert "The model lacks stribeck friction on joint 2" in html and len(html) < 8e6
    assert "What would change our mind" in html and "--effect stribeck_friction:2" in html
    assert (folder / "plots" / "1_stribeck_friction.svg").is_file()


@pytest.mark.long
@posix
def test_a_diagnosis_keeps_below_the_least_limit_that_it_accepts_and_outlives_a_full_disk(tmp_path):
    (tmp_path / "arm.yaml").write_text(TABLE)
    made = simulate(tmp_path / "arm.yaml", runs=[replace(run, duration=8.0) for run in RUNS[:2]])
    command = ["diagnose", write_simulation(made, tmp_path / "twin"), "-o", tmp_path / "out", "--memory"]
    refused = ident(*command, "50MB")
    assert refused.returncode == 2 and "too little for this study" in refused.stderr
    (least,) = re.findall(r"it needs ([0-9.]+)GB", refused.stderr)
    command.append(f"{least}GB")
    _, _, peak = measured([sys.executable, "-m", "ident", *map(str, command)], 1)
    assert 100 < 1.048576 * peak < 1000 * float(least)  # MB
    the_disk_is_full(command, tmp_path / "out")


def test_the_c_of_what_was_found_comes_with_its_numbers(diagnosed):
    folder, _ = diagnosed
    values = json.loads((folder / "model" / "values.json").read_text())
    described = json.loads((folder / "model" / "C_stribeck_friction_2.json").read_text())
    assert set(described["parameters"]) == set(values["chi"])
    assert described["extra_inputs"] == list(values["extra"]) and values["signals"] == []
    found = json.loads((folder / "diagnosis.json").read_text())["findings"][0]["parameters"]
    assert (values["chi"]["Fs2"], values["extra"]["vs2"]) == (found["Fs"]["value"], found["vs"]["value"])
    kept = load_fit(folder)  # what ident export and ident predict take
    chi = dict(zip(kept.columns.parameters, kept.chi))
    assert [chi[name] for term in kept.terms for name in term.names] == pytest.approx(
        [found["Fs"]["value"], found["vs"]["value"]], rel=1e-12
    )


def test_the_extended_study_repeats_the_diagnosis(diagnosed):
    folder, _ = diagnosed
    document = json.loads((folder / "diagnosis.json").read_text())
    study = door.load(folder / "extended_study.yaml")
    again = door.fit(study).document()
    for role, errors in document["error_percent"]["after"].items():
        assert again["full_rate_error_percent"][role] == pytest.approx(errors, rel=1e-6)
    (effect,) = again["effects"]
    for name, its in document["findings"][0]["parameters"].items():
        assert effect["parameters"][name]["value"] == pytest.approx(its["value"], rel=1e-6)
    second = door.diagnose(study)
    assert second.verdict == "none" and second.findings == ()
    assert second.document()["error_percent"]["before"]["test"] == pytest.approx(
        document["error_percent"]["after"]["test"], rel=1e-6
    )


@pytest.mark.skipif(browser.chromium() is None, reason="no chromium on this machine")
def test_reports_of_real_results_open_without_a_complaint(fitted, diagnosed):
    with browser.browser_page() as tab:
        for folder, plots in ((fitted[0], 7), (diagnosed[0], 1)):  # 6 channels and a histogram; one finding
            tab.open(folder / "report.html")
            assert tab.problems == []
            assert tab.evaluate("document.querySelectorAll('.canvas[data-drawn]').length") >= plots
            assert tab.evaluate("document.documentElement.scrollWidth") <= 1200


@pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals of POSIX")
def test_a_terminal_gets_a_bar_and_ruled_tables(study, tmp_path):
    import pty

    main, side = pty.openpty()
    command = [sys.executable, "-m", "ident.command_line.cli", "fit", str(study), "-o", str(tmp_path)]
    with subprocess.Popen(command, stdout=side, stderr=side, env=os.environ | {"TERM": "xterm"}) as process:
        os.close(side)
        seen = b""
        while True:
            try:
                part = os.read(main, 65536)
            except OSError:  # the other side is closed
                break
            if not part:
                break
            seen += part
        assert process.wait(timeout=60) == 0
    os.close(main)
    text = seen.decode()
    assert "evaluating" in text and "┃" in text and "\x1b[" in text


def test_a_recording_that_is_missing_is_named(study, tmp_path):
    text = study.read_text().replace("second.parquet", "sunday.parquet")
    broken = study.parent / "broken.yaml"
    broken.write_text(text)
    for command in ("fit", "diagnose"):
        done = here(command, broken, "-o", tmp_path / "out")
        assert done.returncode == 2 and "sunday.parquet" in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
    assert Path(study).is_file()
