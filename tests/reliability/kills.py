"""Commands killed at random moments: what was there before is whole afterwards, and the next run succeeds."""

from __future__ import annotations

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

from hypothesis import strategies as st

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
LONGEST = 4.0  # s, until the command is done


def _command(folder: Path) -> list[str]:
    more = ["--duration", "5", "--rate", "100", "-o", "out", "--overwrite"]
    return [sys.executable, "-m", "ident.command_line.cli", "simulate", str(folder / "robot.yaml"), *more]


@cache
def _done() -> tuple[Path, dict[str, str]]:
    """A folder in which the command has run once, and what it holds."""
    folder = Path(tempfile.mkdtemp(prefix="reliability-"))
    (folder / "robot.yaml").write_text(TABLE)
    (folder / "mine.txt").write_text("mine")
    done = subprocess.run(_command(folder), cwd=folder, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return folder, _content(folder)


def _content(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


def trial(case: tuple[int, float]) -> None:
    """Kill a second run; see that the first result is whole; run again; see that nothing else stays."""
    (number, share), (original, content) = case, _done()
    folder = Path(tempfile.mkdtemp(prefix="reliability-"))
    try:
        shutil.copytree(original, folder, dirs_exist_ok=True)
        running = subprocess.Popen(
            _command(folder), cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        try:
            running.wait(share * LONGEST)
        except subprocess.TimeoutExpired:
            os.kill(running.pid, SIGNALS[number])
        said = running.communicate(timeout=60)[1]
        assert "Traceback" not in said, said
        left = _content(folder)
        changed = [name for name, sha in content.items() if left.get(name) != sha]
        assert not changed or running.returncode == 0, f"{changed} changed by a run that was stopped"
        done = subprocess.run(_command(folder), cwd=folder, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        stray = set(_content(folder)) - set(content)
        assert not stray, f"{sorted(stray)} stayed behind"
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def cases() -> st.SearchStrategy[Case]:
    """Which signal, and when: a share of the command's time."""
    moments = st.integers(0, 100).map(lambda k: k / 100)
    return st.tuples(st.integers(0, len(SIGNALS) - 1), moments).map(Case)


def random_moments(number: int, seed: int) -> list[tuple[int, float]]:
    """For the slice of the tests."""
    rng = random.Random(seed)
    return [(rng.randrange(len(SIGNALS)), rng.random()) for _ in range(number)]
