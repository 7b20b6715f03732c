"""A command in odd surroundings: seven bits, no home, no folder for what is temporary, nobody who listens."""

import os
import subprocess
import sys

import pytest

from tests.reliability.kills import TABLE

BARE = {"HOME", "XDG_CACHE_HOME", "TMPDIR", "LC_ALL", "LANG", "PYTHONUTF8"}
SURROUNDINGS = {
    "seven bits": {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "no home": {},
    "no temporary folder": {"TMPDIR": "/nonexistent", "HOME": "/nonexistent"},
    "no compiler": {"CC": "/nonexistent"},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("pendulum")
    (place / "robot.yaml").write_text(TABLE)
    made = ident(place, ["simulate", "robot.yaml", "-o", "sim", "--duration", "8", "--rate", "100"])
    assert made.returncode == 0, made.stderr
    return place


def ident(place, arguments, before="", **env):
    plain = {k: v for k, v in os.environ.items() if k not in BARE} if env else dict(os.environ)
    command = [sys.executable, "-m", "ident.command_line.cli", *arguments]
    if before:
        command = ["/bin/sh", "-c", f'exec "$@" {before}', "sh", *command]
    return subprocess.run(command, cwd=place, env=plain | env, capture_output=True, text=True, timeout=120)


@pytest.mark.first_case
@pytest.mark.slow
@pytest.mark.parametrize("name", SURROUNDINGS)
def test_a_fit_in_odd_surroundings(folder, name):
    done = ident(folder, ["fit", "sim/study.yaml", "-o", name], IDENT="", **SURROUNDINGS[name])
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    assert (folder / name / "report.html").is_file()


@pytest.mark.first_case
@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="streams are closed by a POSIX shell")
@pytest.mark.parametrize("stream", [">&-", "2>&-", ">&- 2>&-"])
def test_a_fit_whose_output_nobody_takes(folder, stream):
    done = ident(folder, ["fit", "sim/study.yaml", "-o", "quiet", "--overwrite"], before=stream)
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
