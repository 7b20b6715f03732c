"""Simulated arms that lack nothing, of which something was told (benchmarks/false_findings.py)."""

import pytest

import ident
from benchmarks.false_findings import make

LONG = pytest.mark.long


@pytest.mark.parametrize(
    "seed",
    [
        # a second in which a joint creeps at twice the width of its friction: a body, by 43 nats
        pytest.param(448, marks=LONG),
        # a friction that gives way within 40 urad, as no effect does, was left to effects
        pytest.param(464, marks=LONG),
        # torques of the fitted runs alone: all blocks but one gained by a smaller noise alone
        pytest.param(598, marks=LONG),
        pytest.param(418, marks=LONG),
        # and where the noise is loud with the load
        pytest.param(567, marks=LONG),
        # what steps of the positions hide of a travel was a function of dq1 and what the joint remembers
        pytest.param(534, marks=LONG),
        # the start after a rest: a force, by 3080 nats
        pytest.param(556, marks=LONG),
        # a hum that its samples see as a constant, another in each run: a force on all of one
        pytest.param(698, marks=LONG),
    ],
)
def test_nothing_is_told(tmp_path, seed):
    make(seed, tmp_path)
    found = ident.diagnose(ident.load(tmp_path / "study.yaml"))
    assert found.verdict == "none"
    assert not found.findings and not found.unexplained


@pytest.mark.long
def test_turns_that_steps_of_the_positions_hide_are_no_late_torque(tmp_path):
    """Two slow runs of 50 Hz in steps of 84 urad: one torque was 20 ms late, by 250 nats of rows that turn.
    Each turn comes by as much too late as its steps hid, and beside that no delay is left."""
    make(680, tmp_path)
    assert not ident.diagnose(ident.load(tmp_path / "study.yaml")).findings
