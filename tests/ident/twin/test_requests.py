"""What a user may write behind --effect, and what he is told when he may not."""

import pytest

from ident.twin.requests import EffectRequestError, parse_effect
from modelgen.geometry.robot_file import load_robot

LWR = load_robot("kuka_lwr4p")


def test_joint_and_values_are_read():
    request = parse_effect("torque_ripple:3:A=1.5,wavenumber=20", LWR)
    assert (request.effect.name, request.joint) == ("torque_ripple", 2)
    assert request.values == {"A": 1.5, "wavenumber": 20.0}


def test_a_pair_names_its_source_or_takes_the_neighbour():
    assert parse_effect("joint_coupling:6:source_joint=5", LWR).source_joint == 4
    assert parse_effect("joint_coupling:6", LWR).source_joint == 4
    assert parse_effect("sensor_crosstalk:1", LWR).source_joint == 1


def test_effects_of_the_whole_robot_have_no_joint():
    for text in ("base_tilt", "base_tilt:roll=0.02", "base_tilt::roll=0.02", "time_delay"):
        assert parse_effect(text, LWR).joint is None
    request = parse_effect("payload_change::m=2,recording=run1,from=20", LWR)
    assert (request.recording, request.start, request.stop) == ("run1", 20.0, None)
    assert request.values == {"m": 2.0}


@pytest.mark.parametrize(
    "text, told",
    [
        ("stribek_friction:2", "did you mean stribeck_friction"),
        ("stribeck_friction", "say which joint"),
        ("stribeck_friction:8", "has no joint 8; its joints are 1, 2"),
        ("stribeck_friction:2:Fx=3", "has no parameter 'Fx'; it has Fs, vs"),
        ("stribeck_friction:2:Fs=much", "'much' is no number; write Fs=NUMBER"),
        ("stribeck_friction:2:Fs=nan", "Fs=nan is no number"),
        ("stribeck_friction:2:Fs", "is not KEY=VALUE"),
        ("base_tilt:3", "acts on the whole robot"),
        ("joint_coupling:6:source_joint=6", "is not another joint"),
        ("spring:2:source_joint=6", "has no source_joint"),
        ("payload_change::wavenumber=2", "recording, from, to"),
    ],
)
def test_mistakes_are_told(text, told):
    with pytest.raises(EffectRequestError, match=told):
        parse_effect(text, LWR)


def test_a_load_names_the_link_that_carries_it():
    robot = load_robot("kuka_lwr4p")
    request = parse_effect("payload_change::m=2,link=3", robot)
    assert request.link == 3 and request.values == {"m": 2.0}
    for wrong in ("payload_change::link=9", "payload_change::link=tip"):
        with pytest.raises(EffectRequestError, match="is no row of kuka_lwr4p; write 1 to 7"):
            parse_effect(wrong, robot)
    with pytest.raises(EffectRequestError, match="has no parameter 'link'"):
        parse_effect("stribeck_friction:2:link=3", robot)
