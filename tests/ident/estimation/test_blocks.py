"""Intervals of effects against the spread of their estimates, under noise that is no autoregression."""

import numpy as np
import pytest

from ident.equations.observation import ChannelFactor, DecimatedSegment, RecordingSystem, stack, triangular
from ident.estimation.blocks import BLOCK_S, widened
from ident.estimation.least_squares import channel_sigma, weighted_least_squares
from ident.estimation.noise import channel_noises, honest_covariance

B, CHANNELS, M, HOP = 4, 2, 400, 0.1
NAMES = tuple(f"p{k}" for k in range(B))


def system(W, Y):
    values = W.transpose(0, 2, 1).reshape(CHANNELS * B, M)
    channel, column = np.repeat(np.arange(CHANNELS), B), np.tile(np.arange(B), CHANNELS)
    segment = DecimatedSegment(HOP * np.arange(M), values, Y, np.ones((CHANNELS, M)))
    factors = tuple(ChannelFactor(np.arange(B), triangular(np.column_stack([w, y])), M) for w, y in zip(W, Y))
    return RecordingSystem("run", "identify", None, channel, column, factors, (segment,), M)


def told(W, noise):
    """Estimate's error (b,), standard deviations of the noise model and the widened ones."""
    found = system(W, W @ np.ones(B) + noise)
    factors = stack([found])
    estimate = weighted_least_squares(factors, channel_sigma(factors), NAMES)
    covariance = honest_covariance([found], estimate, channel_noises([found], estimate))
    std = np.sqrt(np.diag(covariance))
    return estimate.chi - 1, std, std * widened([found], estimate, covariance)


@pytest.mark.parametrize("common", [False, True])
def test_intervals_hold_under_noise_of_both_channels_that_comes_with_the_motion(common):
    """Noise that is louder where the first column is, and the same in both channels; and plain noise, where
    the intervals are no more than a fifth longer."""
    rng = np.random.default_rng(3)
    slow = np.cumsum(rng.normal(size=(M, B)), axis=0)
    slow = (slow - slow.mean(axis=0)) / slow.std(axis=0)
    W = np.stack([slow, slow @ np.diag([1, -1, 1, -1])])
    inside, before, wider = [], [], []
    for _ in range(150):
        plain = rng.normal(size=(CHANNELS, M))
        loud = np.abs(slow[:, 0]) * rng.normal(size=M)
        error, std, wide = told(W, np.stack([loud, loud]) + 0.2 * plain if common else plain)
        inside.append(np.abs(error[0]) < 1.96 * wide[0])
        before.append(np.abs(error[0]) < 1.96 * std[0])
        wider.append(wide / std)
    assert np.mean(inside) >= 0.92
    if common:
        assert np.mean(before) < 0.8
    else:
        assert np.median(wider) < 1.2


def test_a_stretch_that_determines_a_parameter_alone_leaves_it_little_known():
    rng = np.random.default_rng(4)
    W = rng.normal(size=(CHANNELS, M, B))
    W[:, round(BLOCK_S / HOP) :, 2] = 0.0
    _, std, wide = told(W, rng.normal(size=(CHANNELS, M)))
    assert np.all(wide >= std) and np.all(np.isfinite(wide))
    assert np.all(wide[[0, 1, 3]] < 1.6 * std[[0, 1, 3]])
