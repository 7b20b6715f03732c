"""What slow noise may say for an effect, of simulated noise that remembers longer than any whitener does."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.signal

from ident.diagnosis.rows.slow_noise import SlowNoise

HOP, SECONDS = 0.05, 30.0
T = np.arange(0, SECONDS, HOP)
MODEL = np.linalg.qr(np.stack([np.ones(len(T)), *(np.sin(0.3 * k * T + k) for k in range(1, 4))], axis=1))[0]
ROWS = SimpleNamespace(t=T, recording=np.zeros(len(T), int), hop=HOP)
NOISE = SlowNoise(ROWS, np.ones(len(T), bool), MODEL, np.eye(4), np.zeros((len(T), 0)), float(len(T) - 4))


def noise(kind, rng):
    """White noise, and slow noise of three times its power."""
    M = len(T)
    white, more = rng.normal(size=M), rng.normal(size=9 * M)
    if kind == "walk":
        slow = np.cumsum(more[:M])
    elif kind == "pink":
        f = np.fft.rfftfreq(9 * M)
        slow = np.fft.irfft(np.fft.rfft(more) / np.sqrt(np.maximum(f, f[1])), 9 * M)[:M]
    else:
        a = np.exp(-HOP / kind)
        slow = scipy.signal.lfilter([1.0], [1.0, -a], more)[-M:]
    return white + np.sqrt(3) * slow / np.std(slow)


def says(y, z):
    """Nats of a column (M,), fitted, and with noise that is white whatever the rows say."""
    left = [v - MODEL @ (MODEL.T @ v) for v in (y, z)]
    e, z = left[0], left[1] / np.linalg.norm(left[1])
    rest = e - z * (z @ e)
    white = 0.5 * NOISE.free * np.log((e @ e) / (rest @ rest))
    return NOISE.likelihoods(rest).max() - NOISE.likelihoods(e).max(), white


@pytest.mark.parametrize("kind", ["walk", "pink", 1.0, 8.0])
def test_slow_noise_is_no_drift(kind):
    """8.3 nats are asked of an effect: chance gives them to one column in 20,000. As if noise were white most
    of these drifts and slow waves had them."""
    rng = np.random.default_rng(1)
    columns = [T, np.exp(-T / 10), np.sin(0.44 * T)]
    told = np.array([says(noise(kind, rng), columns[k % 3]) for k in range(60)])
    assert np.mean(told[:, 1] > 8.3) > 0.5
    assert np.all(told[:, 0] < 8.3) and np.mean(told[:, 0] > 3.3) < 0.1


def test_a_drift_is_told_where_noise_at_the_next_frequencies_is_small():
    """Of half a minute alone one of twelve times the noise is more than a random walk's; white noise would
    have made it hundreds of nats."""
    rng = np.random.default_rng(2)
    told = [says(rng.normal(size=len(T)) + 12.0 * T / SECONDS, T) for _ in range(10)]
    assert min(slow for slow, _ in told) > 8.3 and min(white for _, white in told) > 300


def test_what_is_fast_is_told_as_before():
    """The slow noise beside it is no reason for or against it: as much as in white noise alone."""
    rng = np.random.default_rng(3)
    z = 0.5 * np.sign(np.sin(12.0 * T + 0.1))
    white = says(rng.normal(size=len(T)) + z, z)[1]
    slow = [says(noise("walk", rng) + z, z)[0] for _ in range(10)]
    assert np.mean(slow) > 0.7 * white
