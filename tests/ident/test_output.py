"""Outputs: nothing of the user's is overwritten, and whatever ends a run, a folder holds a whole result."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ident.output import OutputError, staged, write_file
from modelgen.manifest import MANIFEST, written

posix = pytest.mark.skipif(os.name == "nt", reason="signals and limits of POSIX")


def put(folder: Path, files: dict[str, str], **options) -> None:
    with staged(folder, options.pop("command", "ident fit"), **options) as stage:
        for name, text in files.items():
            (stage / name).parent.mkdir(parents=True, exist_ok=True)
            (stage / name).write_text(text)


def content(folder: Path) -> dict[str, str]:
    return {p.relative_to(folder).as_posix(): p.read_text() for p in folder.rglob("*") if p.is_file()}


def test_what_was_written_is_replaced_and_what_is_gone_goes(tmp_path):
    put(tmp_path / "out", {"fit.json": "1", "plots/a.svg": "a"})
    put(tmp_path / "out", {"diagnosis.json": "1"}, command="ident diagnose")
    put(tmp_path / "out", {"fit.json": "2"})
    found = content(tmp_path / "out")
    del found[MANIFEST]
    assert found == {"fit.json": "2", "diagnosis.json": "1"} and not (tmp_path / "out" / "plots").exists()
    assert {name: its[1] for name, its in written(tmp_path / "out").items()} == {
        "fit.json": "ident fit",
        "diagnosis.json": "ident diagnose",
    }
    checked = ["sha256sum", "--check", "--strict", "--quiet", MANIFEST]
    with contextlib.suppress(FileNotFoundError):  # where there is no such program
        assert subprocess.run(checked, cwd=tmp_path / "out").returncode == 0


def test_a_folder_of_somebody_else_is_refused_by_name(tmp_path):
    (tmp_path / "run1.parquet").write_text("an hour of recording")
    with pytest.raises(OutputError, match=r"run1[.]parquet, which was not written by this program"):
        put(tmp_path, {"run1.parquet": "twin"})
    assert content(tmp_path) == {"run1.parquet": "an hour of recording"}
    put(tmp_path, {"run1.parquet": "twin"}, overwrite=True)
    assert content(tmp_path)["run1.parquet"] == "twin"


def test_an_edit_and_a_file_of_ones_own_in_our_folder_stay(tmp_path):
    out = tmp_path / "out"
    put(out, {"study.yaml": "1", "run1": "1"})
    (out / "run2").write_text("mine")
    put(out, {"study.yaml": "2"})
    with pytest.raises(OutputError, match="run2 was not written"):
        put(out, {"study.yaml": "3", "run2": "3"})
    (out / "study.yaml").write_text("mine")
    with pytest.raises(OutputError, match=r"study[.]yaml was changed since it was written"):
        put(out, {"study.yaml": "4"})
    found = content(out)
    assert (found["study.yaml"], found["run2"], "run1" in found) == ("mine", "mine", False)


def test_an_input_is_never_the_target(tmp_path):
    out = tmp_path / "out"
    put(out, {"arm.yaml": "robot"})
    (tmp_path / "link").symlink_to(out / "arm.yaml")
    with pytest.raises(OutputError, match="is an input of this command"):
        put(out, {"arm.yaml": "copy"}, inputs=[tmp_path / "link"], overwrite=True)
    put(out, {"other": ""}, inputs=[tmp_path / "link"])
    assert content(out)["arm.yaml"] == "robot"


@pytest.mark.parametrize("inside", [False, True])
def test_odd_targets_are_one_sentence(tmp_path, inside):
    out = tmp_path / "out"
    if inside:
        put(out, {"a": ""})
        (out / "fit.json").mkdir()
        with pytest.raises(OutputError, match="is a folder where a file is to be written"):
            put(out, {"fit.json": "1"})
        (out / "plots").write_text("")
        with pytest.raises(OutputError, match="stands where a folder is needed"):
            put(out, {"plots/a.svg": "1"})
        return
    (tmp_path / "file").write_text("")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        with pytest.raises(OutputError, match="it is no folder"):
            put(tmp_path / "pipe", {"fit.json": "1"})
    for name, reason in (
        ("file", "it is a file"),
        ("n" * 5000, "too long"),
        ("file/out", "no"),
        ("a\0", "zero byte"),
    ):
        with pytest.raises(OutputError, match=reason) as error:
            put(tmp_path / name, {"fit.json": "1"})
        assert len(str(error.value)) < 1000 and "\n" not in str(error.value)


def test_one_file_is_whole_and_nobody_elses(tmp_path):
    write_file(tmp_path / "new" / "robot.yaml", "one")
    with pytest.raises(OutputError, match="is there already"):
        write_file(tmp_path / "new" / "robot.yaml", "two")
    write_file(tmp_path / "new" / "robot.yaml", "two", overwrite=True)
    assert content(tmp_path) == {"new/robot.yaml": "two"}
    with pytest.raises(OutputError, match="is no file"):
        write_file(tmp_path / "new", "three", overwrite=True)


FILL = """
import resource, sys
from pathlib import Path
from ident.output import OutputError, staged, write_file
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
for folder in (Path("out"), Path("new")):
    try:
        with staged(folder) as stage, staged(stage / "part") as part:
            (stage / "a").write_text("2")
            (part / "b").write_text(20_000 * "b")
    except OutputError as error:
        print(error)
try:
    write_file(Path("c"), 20_000 * "c")
except OutputError as error:
    print(error)
"""


@posix
def test_a_full_disk_leaves_the_old_result(tmp_path):
    put(tmp_path / "out", {"a": "1"})
    done = subprocess.run([sys.executable, "-c", FILL], cwd=tmp_path, capture_output=True, text=True)
    lines = done.stdout.splitlines()
    assert done.returncode == 0 and len(lines) == 3 and done.stderr == ""
    assert all("file too large; make room, or name another folder with -o" in line for line in lines)
    said = [line.split(":")[0].removeprefix("cannot write into ") for line in lines]
    assert said == ["out", "new", "."]
    assert set(content(tmp_path)) == {"out/a", f"out/{MANIFEST}"} and not (tmp_path / "new").exists()


REPEAT = """
import itertools, os, sys
from pathlib import Path
from ident.output import staged
for turn in itertools.count():
    with staged(Path("out")) as stage:
        for k in range(20):
            (stage / f"{k}.txt").write_text(str(turn))
    print(turn, flush=True)
"""


@posix
def test_kill_at_any_moment_leaves_whole_results(tmp_path):
    for k in range(12):
        with subprocess.Popen(
            [sys.executable, "-c", REPEAT], cwd=tmp_path, stdout=subprocess.PIPE
        ) as process:
            process.stdout.readline()
            time.sleep(0.003 * k)
            process.kill()
        put(tmp_path / "out", {"other": ""}, command="another")
        found = content(tmp_path / "out")
        assert len(found) == 22 and len({found[f"{k}.txt"] for k in range(20)}) == 1
        assert not list((tmp_path / "out").glob(".*"))


def test_an_interrupted_move_is_completed_by_the_next_run(tmp_path, monkeypatch):
    out = tmp_path / "out"
    put(out, {"a": "1", "b": "1", "c": "1"})
    move, moved = os.replace, []

    class Killed(BaseException):
        pass

    def killed(source, target):
        if len(moved) == 2:  # the list, then a
            raise Killed
        moved.append(target)
        move(source, target)

    with monkeypatch.context() as patch, pytest.raises(Killed):
        patch.setattr("os.replace", killed)
        patch.setattr("modelgen.output.discard", lambda stage: None)
        put(out, {"a": "2", "b": "2", "c": "2"})
    (out / "c").write_text("mine")
    with pytest.raises(OutputError, match="c was changed"):
        put(out, {"a": "3"})
    found = content(out)
    assert (found["a"], found["b"], found["c"]) == ("2", "2", "mine") and not list(out.glob(".*"))


def test_a_run_beside_this_one_is_left_alone(tmp_path):
    with staged(tmp_path / "out") as stage:
        (stage / "a").write_text("")
        put(tmp_path / "out", {"b": ""})
        assert (stage / "a").is_file()
    assert {"a", "b"} < set(content(tmp_path / "out"))


AT_EVERY_LINE = """
import os, signal, sys
from pathlib import Path
from modelgen.command_line import leave_on_signals
from modelgen import output

def interrupted_at(line):
    left = [line]
    def trace(frame, event, arg):
        if not frame.f_code.co_filename.endswith("output.py"):
            return None
        left[0] -= event == "line"
        if left[0] == 0:
            os.kill(os.getpid(), signal.SIGINT)
        return trace
    return trace

for line in range(1, 1000):
    if not (child := os.fork()):
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # a background job of a shell ignores it
        leave_on_signals("ident")
        sys.settrace(interrupted_at(line))
        with output.staged(Path(sys.argv[1], str(line), "deeper")) as stage:
            for name in ("a", "b"):
                (stage / name).write_text(name)
        os._exit(0)
    if os.WEXITSTATUS(os.waitpid(child, 0)[1]) == 0:
        break
print(line)
"""


@posix
def test_an_interrupt_at_any_line_leaves_all_or_nothing(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", AT_EVERY_LINE, tmp_path], capture_output=True, text=True, check=True
    )
    last = int(done.stdout)
    left = [sorted(content(tmp_path / str(k))) for k in range(1, last)]
    whole = sorted(f"deeper/{name}" for name in ("a", "b", MANIFEST))
    assert last > 50 and left[0] == [] and left[-1] == whole and all(its in ([], whole) for its in left)
    assert [k for k in range(1, last) if (tmp_path / str(k)).exists()] == [
        k for k in range(1, last) if left[k - 1]
    ]


@posix
@pytest.mark.parametrize("module", ["ident", "modelgen.cli"])
def test_control_c_from_the_first_moment_on(module, tmp_path):
    def listen() -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    arguments = ["simulate", "ur10e", "-o", "out"] if module == "ident" else ["ur10e", "-o", "out"]
    # what hears a signal is read before the line that is waited for: until then it is Python's own start
    code = f"import runpy, sys, modelgen.command_line; sys.argv[1:] = {arguments}; print(flush=True); "
    code += f"runpy.run_module('{module}', run_name='__main__')"
    environment = os.environ | {"DYNIDENT_CACHE": str(tmp_path / "cache")}
    for k in range(10):
        with subprocess.Popen(
            [sys.executable, "-c", code],
            cwd=tmp_path,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=listen,
        ) as process:
            process.stdout.readline()
            time.sleep(0.03 + 0.05 * k)
            process.send_signal(signal.SIGINT)
            said = process.stderr.read()
            assert process.wait(timeout=30) == 130, said
        assert said.count("\n") == 1 and "stopped" in said
        assert not (tmp_path / "out").exists()
