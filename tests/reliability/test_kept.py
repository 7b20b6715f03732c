"""What the fuzzer found, shrunk to the smallest input."""

import json

import pytest

from tests.reliability import robot_files
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
