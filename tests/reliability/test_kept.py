"""What the fuzzer found, shrunk to the smallest input."""

import json

import pytest

from tests.reliability import command_lines, recordings, robot_files, studies
from tests.reliability.judge import Case, judged
from tests.reliability.mutations import text_of

ONE = {"joint": "revolute", "antecedent": 0, "alpha": "pi/2", "d": 0, "theta": "q1", "r": 0}


def robot(**keys):
    return {"name": "a", "convention": "mdh", "gravity": [0, 0, -9.81], "links": [ONE]} | keys


KEPT = {
    "a named length that is zero": robot(constants={"e": 0.0}, links=[ONE | {"d": "e"}]),
    "the difference of two equal lengths": robot(
        constants={"e": 0.3, "f": 0.3}, links=[ONE | {"d": "e - f", "r": "e"}]
    ),
}


@pytest.mark.parametrize("name", KEPT)
def test_robot_files_that_were_tracebacks(name):
    outcome = judged(robot_files.trial, Case(text_of(KEPT[name])))
    assert outcome.kind in ("accepted", "refused"), (outcome, json.dumps(KEPT[name]))


def _plain(**changes):
    """A recording as text, some samples of some columns replaced: {column: (row, value)}."""
    table = {name: values.copy() for name, values in recordings.columns().items()}
    for name, (row, value) in changes.items():
        table[name][row] = value
    return recordings.written(table, "csv")


RECORDINGS = {
    "one row with a number that is none": b"\n\nt,q1,q2,tau_m1,tau_m2\n0.0,inf,0.72,4.92,4.86\n",
    "a mark for no value at a time that is none": _plain(t=(399, 1e19), q2=(200, 1e19)),
    "a cell that no terminal should be sent": _plain().replace(b"\n0.0,0.67", b"\n0.0,0.67\x02", 1),
    "such a name of a column": _plain().replace(b",q1", b",\x03q1", 1),
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", RECORDINGS)
def test_recordings_that_were_tracebacks_or_unprintable(name):
    outcome = judged(recordings.trial, Case(recordings.File("csv", RECORDINGS[name])))
    assert outcome.kind in ("accepted", "refused"), outcome


STUDIES = {
    "a term of a thousand letters": {"without": ["a" * 3000]},
    "an unknown key with a bracket": {"columns[": None},
    "an unknown key like a type": {"tuple": 1},
    "a number of a thousand letters": {"effects": ["stribeck_friction:2:Fs=" + "x" * 3000]},
}


@pytest.mark.parametrize("name", STUDIES)
def test_studies_that_were_tracebacks_or_refused_at_length(name):
    outcome = judged(studies.trial, Case(text_of(studies.FULL | STUDIES[name])))
    assert outcome.kind == "refused", outcome


COMMANDS = {"a root for a file": ("ident inspect", "study.yaml", "-o", "/")}


@pytest.mark.parametrize("name", COMMANDS)
def test_command_lines_that_were_tracebacks(name):
    assert judged(command_lines.trial, Case(COMMANDS[name])).kind == "refused"
