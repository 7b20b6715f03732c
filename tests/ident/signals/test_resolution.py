"""Positions of a joint that is slow for its encoder are filtered where they are no motion."""

import numpy as np
import pytest

from ident.signals.filtering import first_difference, second_difference
from ident.signals.low_pass import LowPass, zero_phase
from ident.signals.resolution import in_steps, lowest_cutoff, resolution

STEP = 5e-5


def motion(rate, top, seconds=40.0):
    """Position, rate, acceleration (N,) of five harmonics from 0.07 Hz on, at most `top` fast."""
    t = np.arange(round(seconds * rate)) / rate
    rng = np.random.default_rng(3)
    w, a, phase = 0.44 * np.arange(1, 6), rng.normal(size=5), rng.uniform(0, 6, 5)
    arms = np.outer(t, w) + phase
    q, dq, ddq = np.sin(arms) @ a, np.cos(arms) @ (a * w), -np.sin(arms) @ (a * w**2)
    scale = top / np.abs(dq).max()
    return scale * q, scale * dq, scale * ddq


def errors(q, rate, hz, dq, ddq):
    """Of rate and acceleration, their share."""
    smooth, inner = zero_phase(q, rate, hz)[:, None], slice(int(rate), -int(rate))
    got = first_difference(smooth, rate)[:, 0], second_difference(smooth, rate)[:, 0]
    return np.array([np.std((x - y[2:-2])[inner]) / np.std(y) for x, y in zip(got, (dq, ddq))])


@pytest.mark.parametrize(("rate", "top"), [(100.0, 0.02), (500.0, 0.05), (1000.0, 0.05), (250.0, 0.2)])
def test_rate_and_acceleration_are_told_through_the_steps(rate, top):
    q, dq, ddq = motion(rate, top)
    steps = STEP * np.round(q / STEP)
    assert in_steps(steps, resolution(steps)) and resolution(steps) == pytest.approx(STEP)
    hz = lowest_cutoff(steps, STEP, LowPass(10.0, rate), 40.0)
    told = errors(steps, rate, hz, dq, ddq)
    assert np.all(told < 0.25 * errors(steps, rate, 10.0, dq, ddq)) and told[1] < 0.02


def test_what_is_more_than_rounding_stays():
    """An encoder's own noise, a motion as fast as the filter lets through, a start that one stretch holds."""
    rate, filter = 500.0, LowPass(10.0, 500.0)
    q, _, _ = motion(rate, 0.05)
    noisy = q + 2 * STEP * np.random.default_rng(1).normal(size=len(q))
    fast = q + 20 * STEP * np.sin(2 * np.pi * 9.0 * np.arange(len(q)) / rate)
    start = q + 20 * STEP * np.exp(-(((np.arange(len(q)) / rate - 20.0) / 0.05) ** 2))
    for x, least in ((noisy, 10.0), (fast, 9.0), (start, 4.0)):
        assert lowest_cutoff(STEP * np.round(x / STEP), STEP, filter, 40.0) > least
    assert lowest_cutoff(q, 0.0, filter, 40.0) == np.inf
    assert lowest_cutoff(np.zeros(5000), STEP, filter, 40.0) == np.inf
