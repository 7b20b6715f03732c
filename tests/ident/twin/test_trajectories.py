"""Motions: formulas agree with each other, stay inside the limits, begin and end at rest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ident.twin.trajectories import TrapezoidalAcceleration, fourier, point_to_point, reach
from modelgen.geometry.robot_file import load_robot

SPACE = reach(load_robot("kuka_lwr4p"))


def motions(seed=0):
    rng = np.random.default_rng(seed)
    return [
        point_to_point(SPACE, 44, 90.0, rng),
        point_to_point(SPACE, 7, 20.0, rng),
        fourier(SPACE, 60.0, rng),
    ]


@settings(max_examples=30, deadline=None)
@given(st.floats(0.1, 0.5), st.floats(0.05, 0.5))
def test_a_move_of_unit_length_ends_at_one_and_at_rest(accelerating, ramp):
    profile = TrapezoidalAcceleration(accelerating, ramp)
    x = np.linspace(0, 1, 2001)
    s, v, a = profile(x)
    assert (s[0], s[-1], v[0], v[-1]) == (0, 1, 0, 0)
    just_before = np.nextafter(1.0, 0.0) - np.array([0.0, 1e-15, 1e-12])
    assert profile(just_before)[1].min() >= 0  # or dry friction there takes the other sign for one row
    assert s == pytest.approx(1 - s[::-1], abs=1e-12)  # the way back is the way there
    assert np.cumsum(v)[-1] / 2000 == pytest.approx(1.0, rel=1e-3)
    assert v.max() <= profile.peak_rate * (1 + 1e-12) and np.abs(a).max() <= profile.peak_acceleration * (
        1 + 1e-12
    )


@pytest.mark.parametrize("motion", motions(), ids=lambda m: f"{m.kind} {m.duration:g} s")
def test_rates_are_the_derivatives_of_positions(motion):
    t = np.arange(0, motion.duration, 1e-3)
    q, dq, ddq = motion.at(t)
    # central differences: h^2/6 of the jerk, and at a jump of the jerk h/4 of it
    assert np.abs(np.gradient(q, 1e-3, axis=0) - dq)[1:-1].max() < 1e-4
    assert np.abs(np.gradient(dq, 1e-3, axis=0) - ddq)[1:-1].max() < 0.05


@pytest.mark.parametrize("motion", motions(3), ids=lambda m: f"{m.kind} {m.duration:g} s")
def test_motions_stay_inside_the_limits(motion):
    t = np.arange(0, motion.duration, 2e-3)
    q, dq, ddq = motion.at(t)
    slack = 1.001  # the Fourier series is scaled on a grid of 10 ms
    assert np.all(np.abs(q - SPACE.centre) <= SPACE.half * slack)
    assert np.all(np.abs(dq) <= SPACE.rate * slack) and np.all(np.abs(ddq) <= SPACE.acceleration * slack)
    assert not dq[0].any() and not motion.at(np.array([motion.duration]))[1].any()
    assert np.abs(dq).max(0).min() > 0.2  # rad/s, every joint is excited


def test_the_papers_motion_has_44_points_in_90_seconds():
    motion = point_to_point(SPACE, 44, 90.0, np.random.default_rng(1))
    ends = motion.at(np.arange(46) * 2.0 - 0.05)[0]  # inside the dwell at the end of each move
    assert len(np.unique(ends.round(9), axis=0)) >= 45
    standing = motion.at(np.arange(1, 46) * 2.0 - 0.05)[1]
    assert not standing.any()


def test_limits_come_from_the_robot_file():
    assert SPACE.half == pytest.approx(0.9 * np.array([2.967, 2.094] * 3 + [2.967]), rel=0.11)
    assert np.all(SPACE.rate <= 2.0)
    assert np.all(reach(load_robot("ur10e")).half <= 2.4)
