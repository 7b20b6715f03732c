"""Command lines with accidents, run in process: one line on stderr, exit status 0, 1 or 2, no traceback.

Arguments never ask for long work: what is right in them fails early for want of a recording.
"""

# ruff: noqa: E501  (tables of odd values, a line each)
from __future__ import annotations

import os
import tempfile
from functools import cache
from pathlib import Path

from hypothesis import strategies as st

from tests.reliability.judge import Case
from tests.support.commands import here

CHUNK = 50
STUDY = "robot: ur10e\nmodel: A\nrecordings: [{file: none.csv}]\n"
ROBOT = """\
name: pendulum
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute, antecedent: 0, alpha: pi/2, d: 0, theta: q1, r: 0}
"""
PLACES = (
    "study.yaml", "robot.yaml", "empty", "folder", "pipe", "binary", "nowhere", "", " ", "-", ".", "..", "/", "~",
    "/dev/null", "/dev/zero", "a" * 5000, "$HOME", "${X}", "é.yaml", "a\nb", "folder/study.yaml", "../x", "fit.json",
    "readonly/out", "ur10e", "kuka_lwr4p", "--", "-x", "1", "-1", "nan", "http://x/y", "C:\\x",
)  # fmt: skip
OPTIONS: dict[str, tuple[str, ...]] = {
    "ident fit": ("-o", "-v", "--overwrite", "--models"),
    "ident diagnose": ("-o", "-v", "--max-effects", "--alpha", "--memory", "--overwrite"),
    "ident simulate": ("-o", "--model", "--effect", "--payload", "--seed", "--duration", "--rate", "--noise"),
    "ident predict": ("-o", "--payload", "--episode"),
    "ident export": ("--c", "--urdf", "--mjcf", "--float32", "--name"),
    "ident robot": ("-o", "--exact"),
    "ident inspect": ("-o", "--robot", "--topic", "--exact", "--overwrite"),
    "ident excite": (
        "-o",
        "--model",
        "--duration",
        "--criterion",
        "--motion",
        "--limit",
        "--start",
        "--keep-out",
        "--point",
        "--self-collision",
        "--separate",
        "--from",
        "--evaluate",
        "--parameters",
        "--noise",
        "--rate",
        "--starts",
        "--seed",
    ),
    "ident fleet": ("-o", "--robot", "--study", "--scheduler", "--diagnose"),
    "ident demo": ("-o",),
    "ident": ("--version", "--help", "fti", "fit", "--nonsense"),
    "regenerate-model": (
        "--model",
        "--effect",
        "--rules-only",
        "--json",
        "--markdown",
        "--latex",
        "--check",
        "-o",
    ),
}
VALUES = (
    "A", "E", "a", "A,B", "0", "-1", "1e9", "nan", "inf", "1e400", "x", "", "stribeck_friction:1", "stribeck_friction",
    "stribeck_friction:99", "nothing:1", ":", "::", "stribeck_friction:1:Fs=nan", "stribeck_friction:1:Fs=",
    "payload_change:payload", "torque_ripple:1:k=1e300", "coulomb_friction:-1", "L", "X1", "1" * 400, "é", "\x00",
)  # fmt: skip


class Spoken(Exception):
    """A refusal as the command printed it."""

    exit_status = 2


@cache
def _folder() -> Path:
    place = Path(tempfile.mkdtemp(prefix="reliability-"))
    (place / "study.yaml").write_text(STUDY)
    (place / "robot.yaml").write_text(ROBOT)
    (place / "empty").write_text("")
    (place / "binary").write_bytes(bytes(range(256)))
    (place / "folder").mkdir()
    (place / "fit.json").mkdir()
    os.mkfifo(place / "pipe")
    return place


def trial(line: tuple[str, ...]) -> None:
    """Run it in a folder of its own. Raises Spoken for a refusal, AssertionError for anything else odd."""
    from ident.command_line import cli as ident_cli
    from modelgen import cli as modelgen_cli

    command, *arguments = line
    run = modelgen_cli.run if command == "regenerate-model" else ident_cli.run
    done = here(*command.split()[1:], *arguments, cwd=_folder(), run=run)
    said, status = done.stderr, done.returncode
    assert "Traceback" not in said, said
    assert status in (0, 1, 2), f"exit status {status}"
    if status == 2 and (said.strip() or not done.stdout):  # a bare command shows its help
        lines = said.strip().splitlines()
        raise Spoken(lines[0] if len(lines) == 1 else said)


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """A command, up to three places and up to three options with values, in any order."""
    command = draw(st.sampled_from(sorted(OPTIONS)))
    words = list(draw(st.lists(st.sampled_from(PLACES), max_size=3)))
    if command == "ident simulate":  # right requests are long work
        words += ["--effect", "nothing:1"]
    if command == "ident excite":
        words += ["--separate", "nothing:1,nothing:2"]
    if command == "ident demo":
        words += ["--nonsense"]
    if command in ("ident fit", "ident diagnose", "ident predict") and draw(st.booleans()):
        words += ["-o", draw(st.sampled_from(PLACES))]
    for _ in range(draw(st.integers(0, 3))):
        words += [draw(st.sampled_from(OPTIONS[command])), draw(st.sampled_from((*VALUES, *PLACES)))]
    if command == "regenerate-model":
        words = [w for w in words if w not in ("kuka_lwr4p", "--check")] + ["--rules-only"]
    return Case((command, *words))
