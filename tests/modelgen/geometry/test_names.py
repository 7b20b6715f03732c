"""Names of torques and parameters are read in one place; every name that the models have comes back."""

import pytest

from modelgen.dynamics.models import MODELS
from modelgen.errors import ModelgenError
from modelgen.geometry.names import Channel, ParameterName, joint_unit, unit_of
from modelgen.geometry.robot_file import load_robot


@pytest.mark.parametrize("model", "ABCD")
def test_every_channel_comes_back(model):
    robot = load_robot("kuka_lwr4p")
    for k, name in enumerate(MODELS[model].channels(robot)):
        channel = Channel.of(name, robot.joint_labels)
        assert channel.joint == k % robot.n and channel.name(robot.joint_labels) == name


@pytest.mark.parametrize("name", ["tau_m9", "tau_x1", "q1", "tau_m"])
def test_a_torque_that_is_not_there_is_refused(name):
    with pytest.raises(ModelgenError, match="is no torque of this robot"):
        Channel.of(name, ("1", "2"))


@pytest.mark.parametrize("robot", ["kuka_lwr4p", "ur10e"])
def test_units_and_sides_are_those_of_the_standard_parameters(robot):
    robot = load_robot(robot)
    for p in MODELS["C"].standard_parameters(robot, "L"):
        for name in (p.name, f"{p.name}R"):
            read = ParameterName.of(name)
            assert read is not None
            assert (read.kind, read.label, read.payload, read.regrouped) == (
                p.kind, p.label, p.payload, name.endswith("R"),
            )  # fmt: skip
            assert read.standard == p.name
            assert read.unit() == p.unit
            assert read.of_body == (read.side is None)


@pytest.mark.parametrize("name", ["", "q1", "Iam", "IamL", "stribeck", "Fs2", "R", "XX"])
def test_other_names_are_not_the_papers(name):
    assert ParameterName.of(name) is None and unit_of(name) == ""


def test_a_payload_may_end_in_r():
    assert ParameterName.of("MGRIPPER", ("GRIPPER",)).label == "GRIPPER"
    assert ParameterName.of("MXGRIPPERR", ("GRIPPER",)).regrouped
    assert ParameterName.of("MXtool", ("L",)) is None


@pytest.mark.parametrize(
    "unit, slides, source, expected",
    [
        ("N m", True, None, "N"), ("N m s/rad", True, None, "N s/m"), ("N m/rad", True, None, "N/m"),
        ("rad/(N m)", True, None, "m/N"), ("1/rad", True, None, "1/m"), ("rad/s", True, None, "m/s"),
        ("kg m^2", True, None, "kg"), ("kg m^2", True, False, "kg m"), ("N m s/rad", False, True, "N m s/m"),
        ("N m s^2/rad^2", True, None, "N s^2/m^2"), ("N m (s/rad)^p", True, None, "N (s/m)^p"),
        ("N m s/rad", False, None, "N m s/rad"), ("-", True, None, "-"), ("s", True, None, "s"),
    ],
)  # fmt: skip
def test_units_follow_the_joint(unit, slides, source, expected):
    assert joint_unit(unit, slides, source) == expected


def test_friction_of_a_slide_is_in_newton():
    assert unit_of("Fcm2R", ("2",)) == "N" and unit_of("Fcm1", ("2",)) == "N m"
    assert unit_of("Fvl2", ("2",)) == "N s/m" and unit_of("XX2", ("2",)) == "kg m^2"
    assert unit_of("g2", ("2",)) == "N/unit"
