"""The low-pass of torque and columns: gain, delay, and what is left out."""

from types import SimpleNamespace

import numpy as np
import pytest

from ident.diagnosis.rows import build_rows

CHANNELS = ("tau_m1",)


def recording(q, tau, rate=500.0, role="identify", label="run"):
    t = np.arange(len(q)) / rate
    return SimpleNamespace(
        label=label, role=role, payload=None, t=t, q=q[:, None], tau_m=tau[:, None], tau_l=None
    )


@pytest.fixture
def swing():
    t = np.arange(10_000) / 500.0
    return t, np.sin(1.7 * t)


def test_velocity_and_acceleration_of_a_sine(swing):
    _, q = swing
    fine = build_rows([recording(q, q)], CHANNELS).fine
    inside = (fine.t > 1) & (fine.t < 18)
    # the position filter (40 Hz) and central differences at 500 Hz change a 0.3 Hz sine by less than 1e-5
    np.testing.assert_allclose(fine.dq[inside, 0], 1.7 * np.cos(1.7 * fine.t[inside]), atol=1e-4)
    np.testing.assert_allclose(fine.ddq[inside, 0], -(1.7**2) * np.sin(1.7 * fine.t[inside]), atol=1e-3)


@pytest.mark.parametrize("delay", [0.0, 0.0013, 0.02])
def test_shifted_taps_delay_by_any_time(swing, delay):
    _, q = swing
    rows = build_rows([recording(q, q)], CHANNELS)
    signal = np.sin(3.0 * rows.fine.t)
    got = rows.filter.matrix(delay) @ signal
    np.testing.assert_allclose(got, np.sin(3.0 * (rows.t - delay)), atol=2e-3)  # pass band ripple of 53 dB


def test_white_noise_comes_through_nearly_white(swing):
    _, q = swing
    rng = np.random.default_rng(0)
    rows = build_rows([recording(q, rng.normal(size=len(q)))], CHANNELS)
    y = rows.y[0] - rows.y[0].mean()
    assert abs(y[1:] @ y[:-1]) / (y @ y) < 0.35  # 2.5 rows per cut-off period


def test_rest_is_left_out():
    t = np.arange(10_000) / 500.0
    q = np.where(t < 8, np.sin(1.7 * t), np.sin(1.7 * 8))
    rows = build_rows([recording(q, q)], CHANNELS)
    assert rows.keep[0, rows.t < 7.5].all() and not rows.keep[0, rows.t > 9].any()


def test_a_gap_splits():
    t = np.concatenate([np.arange(3000), np.arange(4000, 8000)]) / 500.0
    one = recording(np.sin(t), np.sin(t))
    one.t = t
    rows = build_rows([one], CHANNELS)
    assert len(rows.fine.pieces) == 2
    assert not ((rows.t > 5.8) & (rows.t < 8.1)).any()
