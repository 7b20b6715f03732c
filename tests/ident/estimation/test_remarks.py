"""What a fit says of its own numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from ident.estimation.remarks import excitation, implausible
from ident.examination.check import Check

SCALED = Check("torque_scale", ("tau_m2",), "in N mm", "columns: {tau_m2: {scale: 0.001}}")
RESTS = Check("resting_joint", ("q1",), "joint 1 never moves", "move it")


@pytest.mark.parametrize(("told", "said"), [((), True), ((RESTS,), True), ((SCALED, RESTS), False)])
def test_bodies_larger_than_robots_are_what_a_signal_s_unit_makes_them(told, said):
    """Of a KR 300 with one torque in N mm all were to be scaled; with positions in turns so, too."""
    estimate = SimpleNamespace(parameters=("M2", "ZZ3R"), chi=np.array([4e5, 9e4]))
    checks = implausible(estimate, np.ones(2), ("tau_m1", "tau_m2"), (), told)
    assert [c.check for c in checks] == (["torque_scale"] if said else [])
    assert all("or one of them" in c.message and "positions or time" in c.message for c in checks)


def test_an_offset_that_others_take_off_again_is_no_unit():
    """Of a KR 300 with an axis turned in its table: its torques of 5 kN m were to be N mm."""
    estimate = SimpleNamespace(parameters=("Offm2R", "MY2"), chi=np.array([7.4e4, -7.4e3]))
    assert not implausible(estimate, np.array([1.5e4, 1.5e3]), ("tau_m2",), ())


def test_a_joint_that_slides_in_the_robot_file_is_asked_for_first():
    """Of a KR 300 whose first joint slid there all torques were to be N mm."""
    estimate = SimpleNamespace(parameters=("M1R",), chi=np.array([5e3]))
    (check,) = implausible(estimate, np.ones(1), ("tau_m1",), (), (), ["1"])
    assert check.remedy.startswith("correct the robot file if joint 1 does not slide; ")


DEGREES = Check("angle_unit", ("q4",), "q4 is in degrees", "columns: {q4: {scale: 0.0174533}}", recording="b")


@pytest.mark.parametrize(("told", "blind"), [((), ["a"]), ((RESTS,), ["a"]), ((DEGREES,), [])])
def test_a_recording_in_another_unit_says_nothing_of_how_others_excite(told, blind):
    """Of a TX40 with its fourth position in degrees in one run the other was told to excite too little."""
    full = SimpleNamespace(
        parameters=("XX4R", "ZZ4R"), chi=np.ones(2), sigma=np.ones(1), dependent=(), weak=()
    )
    factors = [SimpleNamespace(columns=np.arange(2), R=R, rows=10) for R in (np.eye(3), np.eye(3))]
    factors[1].R = np.diag([1e3, 1.0, 1.0])
    systems = [SimpleNamespace(label=label, factors=(its,)) for label, its in zip("ab", factors)]
    assert [c.recording for c in excitation(full, systems, (), (), told)] == blind
