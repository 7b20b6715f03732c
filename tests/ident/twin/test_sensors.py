"""Sensors: noise of the stated level and colour, encoder steps, delays, time stamps."""

import numpy as np
import pytest

from ident.twin.sensors import (
    Sensors,
    coloured_noise,
    encoder,
    measured,
    noise_level,
    sampling_times,
)


def test_noise_has_the_stated_variance_and_correlation():
    sensors = Sensors(noise_correlation_s=0.01)
    e = coloured_noise((200_000, 2), sensors, np.random.default_rng(0))
    a = np.exp(-0.1)
    assert e.var(axis=0) == pytest.approx(1.0, rel=0.05)  # 200 000 samples, 20 correlated: 1 % one sigma
    assert np.mean(e[1:] * e[:-1], axis=0) == pytest.approx(a, rel=0.05)
    assert abs(np.mean(e[:, 0] * e[:, 1])) < 0.05
    assert e[:50].var() == pytest.approx(1.0, rel=0.9)  # no start-up: stationary from the first sample


def test_level_is_a_share_of_the_torque_but_not_below_the_floor():
    true = np.stack([np.full(10, 40.0), np.zeros(10)], axis=1)
    sensors = Sensors(noise_percent=2.0, noise_floor=0.01)
    assert noise_level(true, sensors) == pytest.approx([0.8, 0.01])
    assert measured(true, np.zeros((10, 2)), np.ones(2), sensors) == pytest.approx(true, abs=1e-5)


def test_encoder_counts():
    q = encoder(np.array([0.0, 1.4e-5, 1.0]), Sensors(encoder_step=1e-5))
    assert q == pytest.approx([0.0, 1e-5, 1.0], abs=1e-12)


def test_jitter_never_swaps_samples():
    t = sampling_times(10.0, Sensors(jitter_s=0.002), np.random.default_rng(0))
    assert t[0] == 0.0 and np.diff(t).min() > 0 and np.diff(t).std() > 1e-4
    assert np.array_equal(sampling_times(1.0, Sensors(), np.random.default_rng(0)), np.arange(1001) / 1000)
