"""Commands killed at random moments: what was there before is whole afterwards, and the next run succeeds."""

from __future__ import annotations

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

from hypothesis import strategies as st

from modelgen.manifest import MANIFEST, is_ours, written
from modelgen.output import UNFINISHED
from tests.reliability.judge import Case

CHUNK = 5
HANG_S = 180  # a trial runs the command twice
TABLE = """\
name: pendulum
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute, antecedent: 0, alpha: pi/2, d: 0, theta: q1, r: 0, limits: {q: [-2, 2], dq: 3, ddq: 20}}
"""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
COMMANDS = {  # name: module, arguments (the folder's own files by name), s until it is done
    "simulate": ("ident", "simulate robot.yaml --duration 5 --rate 100 -o out --overwrite", 4.0),
    "fit": ("ident", "fit made/study.yaml -o out --overwrite", 4.0),
    "diagnose": ("ident", "diagnose made/study.yaml -o out --overwrite", 15.0),
    "excite": ("ident", "excite robot.yaml --duration 4 --starts 1 -o out --overwrite", 15.0),
    "predict": ("ident", "predict fitted made/run1.parquet -o out --overwrite", 4.0),
    "export": ("ident", "export fitted --c out --overwrite", 4.0),
    "regenerate-model": ("modelgen.cli", "robot.yaml --model A -o out", 4.0),
}


def _command(name: str) -> list[str]:
    module, arguments, _ = COMMANDS[name]
    return [sys.executable, "-m", module, *arguments.split()]


def _run(name: str, folder: Path) -> None:
    done = subprocess.run(_command(name), cwd=folder, capture_output=True, text=True, timeout=150)
    assert done.returncode in (0, 1), done.stderr  # 1: a diagnosis found something


@cache
def _begun() -> Path:
    """A folder with a robot, a study, a fit, and a file of the user's."""
    folder = Path(tempfile.mkdtemp(prefix="reliability-"))
    (folder / "robot.yaml").write_text(TABLE)
    (folder / "mine.txt").write_text("mine")
    more = ["--duration", "5", "--rate", "100", "-o", "made"]
    subprocess.run([sys.executable, "-m", "ident", "simulate", "robot.yaml", *more], cwd=folder, check=True,
                   capture_output=True)  # fmt: skip
    subprocess.run([sys.executable, "-m", "ident", "fit", "made/study.yaml", "-o", "fitted"], cwd=folder,
                   check=True, capture_output=True)  # fmt: skip
    return folder


@cache
def _done(name: str) -> tuple[Path, dict[str, str]]:
    """A folder in which the command has run once, and what it holds."""
    folder = Path(tempfile.mkdtemp(prefix="reliability-"))
    shutil.copytree(_begun(), folder, dirs_exist_ok=True)
    _run(name, folder)
    return folder, _content(folder)


def _content(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


def _whole(out: Path) -> bool:
    """Whether every file is as its list of hashes says, or a run that got as far as its commit left the rest
    for the next one."""
    alike = all(is_ours(out / name, entry) for name, entry in written(out).items())
    return alike or any((stage / MANIFEST).is_file() for stage in out.glob(f"{UNFINISHED}*"))


def trial(case: tuple[str, int, float]) -> None:
    """Kill a second run; see that the first result is whole; run again; see that nothing else stays."""
    name, number, share = case
    original, content = _done(name)
    folder = Path(tempfile.mkdtemp(prefix="reliability-"))
    try:
        shutil.copytree(original, folder, dirs_exist_ok=True)
        running = subprocess.Popen(
            _command(name),
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            running.wait(share * COMMANDS[name][2])
        except subprocess.TimeoutExpired:
            os.kill(running.pid, SIGNALS[number])
        said = running.communicate(timeout=60)[1]
        assert "Traceback" not in said, said
        left = _content(folder)
        changed = [name for name, sha in content.items() if left.get(name) != sha]
        assert not changed or _whole(folder / "out"), f"{changed} changed by a run that was stopped"
        _run(name, folder)
        stray = set(_content(folder)) - set(content)
        assert not stray, f"{sorted(stray)} stayed behind"
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def cases() -> st.SearchStrategy[Case]:
    """Which command, which signal, and when: a share of the command's time."""
    moments = st.integers(0, 100).map(lambda k: k / 100)
    return st.tuples(st.sampled_from(sorted(COMMANDS)), st.integers(0, len(SIGNALS) - 1), moments).map(Case)
