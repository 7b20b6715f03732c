"""White noise is the noise that was put in, whatever the model lacks."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.signal

from ident.diagnosis.rows.whitened import Whitener, burg
from ident.diagnosis.telling.floor import _of_counted, white_noise_power
from ident.diagnosis.telling.unforeseen import _variance
from ident.equations.comparison import Curves
from ident.equations.fine import _taps
from ident.signals.filtering import LowPass

RATE, CUTOFF = 250.0, 10.0


def curves(wrong: float, corner_hz: float, seed: int) -> tuple[Curves, float]:
    """60 s of a slow motion's torque with a model that is wrong by a share, and noise through the filter."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 60, 1 / RATE)
    q = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in (0.1, 0.23, 0.4, 0.71))
    torque = 20 * np.sin(q) + 3 * np.tanh(np.gradient(q, t) / 0.05)
    pole = np.exp(-2 * np.pi * corner_hz / RATE)
    noise = scipy.signal.lfilter([1.0], [1.0, -pole], rng.normal(size=len(t)))
    sos = scipy.signal.butter(4, CUTOFF, fs=RATE, output="sos")
    torque, noise = scipy.signal.sosfiltfilt(sos, torque), scipy.signal.sosfiltfilt(sos, noise)
    every = int(RATE / (5 * CUTOFF))
    pick = slice(0, None, every)
    made = Curves(
        "run", "identify", t[pick], (torque + noise)[pick, None], ((1 - wrong) * torque)[pick, None]
    )
    return made, float(np.mean(noise**2))


@pytest.mark.parametrize("wrong", [0.0, 0.03, 0.1])
@pytest.mark.parametrize("corner_hz", [5.0, 16.0, 100.0])
def test_it_is_the_noise_and_not_what_the_model_lacks(wrong, corner_hz):
    """Within a fifth, in noise from white to coloured in the band, the model wrong by up to 10 %."""
    seen = [
        np.sqrt(white_noise_power(made, 0, LowPass(CUTOFF, RATE)) / true)
        for made, true in (curves(wrong, corner_hz, seed) for seed in range(3))
    ]
    assert np.median(seen) == pytest.approx(1.0, abs=0.2)


def test_nothing_is_said_where_no_frequency_is_without_motion():
    made, _ = curves(0.0, 16.0, 0)
    assert white_noise_power(made, 0, LowPass(0.5, RATE)) is None


@pytest.mark.parametrize("slow", [0.0, 0.3, 3.0])
def test_white_noise_is_no_more_than_what_its_past_does_not_foretell(slow):
    """Through the filter of the rows, beside what a model lacks of a motion, so many times its size."""
    rng, every, n = np.random.default_rng(1), 24, 60_000
    filter, t = LowPass(0.4 * RATE / every, RATE, 4), np.arange(n) / RATE
    lacks = np.sin(1.5 * np.sin(2 * np.pi * 0.1 * t) + 2 * np.sin(2 * np.pi * 0.23 * t))
    taps = _taps(filter)
    rows = np.convolve(rng.normal(size=n) + slow * lacks, taps, "same")[::every]
    coefficients, _, variance = burg(rows, np.ones(len(rows), bool), np.zeros(len(rows)), 10)
    its = Whitener(None, np.sqrt(variance), coefficients, np.zeros(0))
    found = np.sqrt(_variance(its, SimpleNamespace(taps=taps, every=every)))
    assert 0.9 < found < 1.8
    assert np.std(rows) / np.sqrt(taps @ taps) > slow  # where 17 times as much is left


@pytest.mark.parametrize("rests", [0.0, 0.3])
def test_the_floor_is_of_samples_that_move(rests):
    """A friction at rest of twenty times the noise, in a share of the run: the noise is told."""
    rng, hop, n = np.random.default_rng(2), 0.05, 6000
    t = np.arange(n) * hop / 5
    still = (np.sin(2 * np.pi * t / 20.0) > 1 - 2 * rests) if rests else np.zeros(n, bool)
    noise = rng.normal(size=n)
    measured = (noise + 20.0 * still)[:, None]
    its = Curves("run", "identify", t, measured, np.zeros((n, 1)))
    rows = SimpleNamespace(
        t=t[2::5], recording=np.zeros(n // 5, int), names=("run",), use=~still[None, 2::5], hop=hop
    )
    fit = SimpleNamespace(errors=SimpleNamespace(curves=(its,)))
    kept = _of_counted(fit, rows, 0) * np.sqrt(np.mean(measured**2))
    assert kept == pytest.approx(np.std(noise), rel=0.05)
