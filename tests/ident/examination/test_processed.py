"""Columns that were interpolated or scaled before they came here."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, planted, refused, tables, ur10e

from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.processed import interpolated, scaled
from ident.examination.tables.signals import Columns
from ident.examination.undone import unsettled


def _said(check, q, tau, t=None, rows=4000):
    t = np.arange(rows) / 200.0 if t is None else t
    excerpt, signals = Excerpt(), ("q1", "q2", "tau_m1", "tau_m2")
    for part in np.array_split(np.arange(len(t)), 3):
        excerpt.take((part, t[part], np.hstack([q, tau])[part]))
    columns = Columns("run", signals, np.array([0, 1, 0, 1]), ("1", "2"), {}, signals[2:], np.zeros(2, bool))
    return list(check(columns, excerpt, set()) if check is interpolated else check(columns, excerpt))


def _motion(t):
    rng = np.random.default_rng(1)
    q = np.stack([np.sin(0.9 * t), 0.4 * np.cos(1.7 * t) + 0.2], 1)
    return q, 5 * np.stack([np.cos(0.9 * t), np.sin(2.1 * t) + 1], 1) + 0.1 * rng.normal(size=q.shape)


def _as(x, digits):
    single = digits is np.float32
    return x if digits is None else x.astype(np.float32).astype(float) if single else np.round(x, digits)


@pytest.mark.parametrize("digits", [None, 5, np.float32])
def test_signals_that_go_straight_between_the_samples_of_a_slower_log(digits):
    t = np.arange(4000) / 200.0
    q, tau = _motion(t)
    slow = np.arange(0, 20.1, 0.1)
    between = np.stack([np.interp(t, slow, np.interp(slow, t, x)) for x in q.T], 1)
    q, between = (_as(x, digits) for x in (q, between))
    (said,) = _said(interpolated, between, tau)
    assert said.signals == ("q1", "q2") and "recorded at 10" in said.message
    assert not _said(interpolated, q, tau)
    assert not _said(interpolated, np.round(q, 3), np.round(tau, 1))


def test_few_bends_that_coarse_steps_let_through_tell_no_rate():
    """Steps of a 2000th of the span at 50 Hz, read at 20 Hz and interpolated: where most bends are below the
    steps, those that are left stand five rows apart, and ten."""
    t, slow = np.arange(1800) / 50.0, np.arange(0, 36, 0.05)
    rng = np.random.default_rng(3)
    for _ in range(20):
        waves = rng.uniform(0.2, 2.5, (2, 5, 1)), rng.uniform(0, 7, (2, 5, 1))
        q = np.sin(waves[0] * t + waves[1]).sum(axis=1)
        step = np.ptp(q, axis=1, keepdims=True) / 2000
        coarse = step * np.rint(q / step)
        between = np.stack([np.interp(t, slow, np.interp(slow, t, x)) for x in coarse], 1)
        assert not _said(interpolated, between, _motion(t)[1], t)


@pytest.mark.parametrize("ramp", [1, 60])
@pytest.mark.parametrize("bits", [None, 12, 16, 20])
def test_rates_that_hold_are_straight_too(bits, ramp):
    """Of steps that a rate crosses so many at a time, and one more every so many rows, a line of a slower
    log was made, and of strokes to and fro at one rate."""
    t, step = np.arange(8000) / 200.0, 2 * np.pi / 2 ** (bits or 60)
    to_and_fro = [
        np.where(t / period % 1 < 0.5, 1.0, -1.0) * 4 * a / period for a, period in ((0.8, 3), (0.7, 4.1))
    ]
    dq = [np.convolve(np.pad(x, (ramp - 1, 0), "edge"), np.ones(ramp) / ramp, "valid") for x in to_and_fro]
    q = np.cumsum(dq, axis=1).T / 200.0
    assert not _said(interpolated, step * np.rint(q / step) if bits else q, _motion(t)[1], t)


@pytest.mark.parametrize("bits", [16, 18])
def test_a_sine_is_straight_about_its_middle_alone(bits):
    t, step = np.arange(2850) / 50.0, 2 * np.pi / 2**bits
    q = 0.14 * (1 + 0.6 * np.sin(0.4 * t[:, None])) * np.sin(np.pi * t[:, None] / [1.03, 1.4])
    assert not _said(interpolated, step * np.rint(q / step), _motion(t)[1], t)


def test_columns_that_were_scaled():
    t = np.arange(4000) / 200.0
    q, tau = _motion(t)
    every = np.hstack([q, tau])
    one = (every - every.mean(axis=0)) / every.std(axis=0)
    (said,) = _said(scaled, one[:, :2], one[:, 2:])
    assert said.outcome == "refused" and "mean 0 and deviation 1" in said.message
    (said,) = _said(scaled, q, tau - tau.mean(axis=0))
    assert said.signals == ("tau_m1", "tau_m2") and "mean 0" in said.message
    assert unsettled([said]) == (said,)  # no effect is told as if these were torques
    (said,) = _said(scaled, q, tau / np.abs(tau).max(axis=0))
    assert "are 1 each where they are largest" in said.message
    assert not _said(scaled, q, tau) and not _said(scaled, q - q.mean(axis=0), tau)


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_positions_of_5_hz_and_standardised_columns_of_a_measured_robot(tmp_path):
    """Of a UR10e 16 % were left for 5, and nothing was said."""

    def between(columns):
        t, slow = columns["t"], np.arange(columns["t"][0], columns["t"][-1], 0.2)
        own = {k: np.interp(t, slow, np.interp(slow, t, x)) for k, x in columns.items() if k[0] == "q"}
        return {k: x for k, x in (columns | own).items() if k[:2] != "dq"}

    said = [c for c in tables(planted(tmp_path, between)) if c.check == "held_signal"]
    assert len(said) == 2 and all(c.signals == ("q1", "q2", "q3", "q4", "q5", "q6") for c in said)
    learnt = lambda c: {k: x if k == "t" else (x - x.mean()) / max(x.std(), 1e-9) for k, x in c.items()}  # noqa: E731
    message, _ = refused(planted(tmp_path, learnt))
    assert "standardised" in message
    assert not [c for c in tables(ur10e()) if c.check in ("held_signal", "scaled_columns")]
