"""Filters against plain twins that hold the whole signal: scipy's sosfiltfilt and sosfilt."""

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from ident.recordings.study import FilterSettings
from ident.signals.decimation import Decimator, decimate, kept_every
from ident.signals.filtering import (
    LowPass,
    certainty,
    filter_bank,
    first_difference,
    second_difference,
    smooth_sign,
    velocity_noise,
    windows,
    zero_phase,
)


@pytest.mark.parametrize(
    ("rate", "cutoff", "order"), [(1000, 10, 4), (100, 8, 4), (250, 20, 2), (5000, 100, 5)]
)
def test_zero_phase_is_sosfiltfilt(rate, cutoff, order):
    x = np.cumsum(np.random.default_rng(0).normal(size=(20000, 2)), axis=0)
    halo = LowPass(cutoff, rate, order).halo
    plain = scipy.signal.sosfiltfilt(
        scipy.signal.butter(order, cutoff, fs=rate, output="sos"), x, axis=0, padtype="odd", padlen=halo
    )
    # 1e-9: the impulse response is cut at 1e-10 of its peak, the plain twin starts from a guessed state
    assert np.abs(zero_phase(x, rate, cutoff, order) - plain).max() < 1e-8 * np.abs(x).max()


@given(st.lists(st.integers(1, 9000), min_size=1, max_size=6), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_windows_are_the_whole_signal_however_it_is_cut(sizes, seed):
    x = np.random.default_rng(seed).normal(size=(sum(sizes), 2))
    pieces = np.split(x, np.cumsum(sizes)[:-1])
    halo = 300
    rows, start = [], 0
    for first, window, inner in windows(iter(pieces), halo):
        assert first == start
        assert inner.start == halo and len(window) == inner.stop + halo
        rows.append(window[inner])
        start += len(rows[-1])
    assert np.array_equal(np.concatenate(rows), x)


def plain_decimation(x, rate, cutoff, order):
    """Forward and backward filter of the signal between long zeros, every row scaled to unit gain."""
    sos = scipy.signal.butter(order, cutoff, fs=rate, output="sos")
    pad = np.zeros((int(40 * rate / cutoff), x.shape[1]))

    def both_ways(z):
        z = np.concatenate([pad, z, pad])
        return scipy.signal.sosfilt(sos, scipy.signal.sosfilt(sos, z, axis=0)[::-1], axis=0)[::-1][
            len(pad) : -len(pad)
        ]

    every = kept_every(cutoff, rate)
    return (both_ways(x) / both_ways(np.ones_like(x)))[every - 1 :: every]


@pytest.mark.parametrize(
    ("rate", "cutoff", "order"), [(1000, 0.8, 4), (1000, 4, 3), (100, 4, 4), (100, 30, 4), (250, 5, 1)]
)
def test_decimation_is_the_plain_filter_at_kept_instants(rate, cutoff, order):
    x = np.random.default_rng(1).normal(size=(15000, 2)) + 1
    assert np.allclose(decimate(x, rate, cutoff, order), plain_decimation(x, rate, cutoff, order), atol=1e-9)


@given(st.lists(st.integers(1, 3000), min_size=1, max_size=8))
@settings(max_examples=25, deadline=None)
def test_decimation_does_not_see_block_boundaries(sizes):
    x = np.random.default_rng(2).normal(size=(sum(sizes), 3))
    decimator = Decimator(LowPass(2.0, 200), kept_every(2.0, 200), 3)
    parts = [decimator.push(piece.T) for piece in np.split(x, np.cumsum(sizes)[:-1])] + [decimator.finish()]
    assert np.allclose(
        np.hstack([part for part in parts if part is not None]).T, decimate(x, 200, 2.0), atol=1e-9
    )


@given(st.integers(0, 4))
def test_differences_are_exact_on_quartics(power):
    rate = 50.0
    t = np.arange(40) / rate
    q = (t**power)[:, None]
    inner = t[2:-2]
    first = power * inner ** max(power - 1, 0) if power else 0 * inner
    second = power * (power - 1) * inner ** max(power - 2, 0) if power > 1 else 0 * inner
    assert np.allclose(first_difference(q, rate)[:, 0], first, atol=1e-9)
    assert np.allclose(second_difference(q, rate)[:, 0], second, atol=1e-7)


def test_a_joint_that_flickers_by_a_step_at_rest_does_not_move():
    """Of a UR10e's run of one joint the third, at rest, counted in a sixth of it: a load of 4 kg was told."""
    step, bank = 1e-4, filter_bank(FilterSettings(), 95.0)
    rng = np.random.default_rng(3)
    q = step * (rng.random(6000) < 0.03)  # on the edge of a step, so that it is seldom on the other one
    steps = np.array([step])
    noise, rounded = velocity_noise(q[:, None], bank), velocity_noise(q[:, None], bank, steps)
    dq = first_difference(zero_phase(q, 95.0, 38.0)[:, None], 95.0)
    assert certainty(dq, 2 * noise).mean() > 0.05 and certainty(dq, 2 * rounded).mean() < 0.02
    fast = step * np.round(
        np.sin(np.arange(6000) / 95.0) / step
    )  # of one that moves the scatter says the same
    seen, rounded = velocity_noise(fast[:, None], bank), velocity_noise(fast[:, None], bank, steps)
    assert rounded[0] == pytest.approx(seen[0], rel=0.1)


def test_velocity_noise_is_what_comes_out():
    rng = np.random.default_rng(3)
    rate, sigma = 1000.0, 1e-4
    t = np.arange(60000) / rate
    q = np.sin(2 * np.pi * 0.2 * t)[:, None] + sigma * rng.normal(size=(60000, 1))
    bank = filter_bank(FilterSettings(), rate)
    true = 0.4 * np.pi * np.cos(2 * np.pi * 0.2 * t)
    left = first_difference(zero_phase(q, rate, bank.sign.cutoff_hz), rate)[:, 0] - true[2:-2]
    assert velocity_noise(q, bank)[0] == pytest.approx(left[1000:-1000].std(), rel=0.1)


def test_sign_is_certain_or_does_not_count():
    vs = np.array([0.01])
    dq = np.array([[-1.0], [-0.02], [-0.01], [0.0], [0.005], [0.02], [1.0]])
    weight, sign = certainty(dq, vs), smooth_sign(dq, vs)
    assert np.all(weight[np.abs(dq) <= 0.01] == 0) and np.all(weight[np.abs(dq) >= 0.02] == 1)
    assert np.allclose(sign[weight > 0], np.sign(dq)[weight > 0], atol=2e-4)
    assert certainty(np.zeros((1, 1)), np.zeros(1)) == 0
