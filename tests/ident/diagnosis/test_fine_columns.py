"""Columns made at the fine rate land on the equations' own rows, with the equations' own weights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ident.diagnosis.rows.terms import Scene
from ident.equations.fine import SIGNALS, FineSegment, _strided, _taps, stride_of
from ident.signals.decimation import FINE_HZ, decimate, kept_every, means_about
from ident.signals.filtering import LowPass

CUTOFF, RATE = 5.0, 1000.0


def segment(N, stride, certain=None):
    """A stretch whose fine samples are every stride-th of one sampled at RATE, as FineKeeper takes them."""
    every = kept_every(CUTOFF, RATE)
    n = len(range(stride - 1, N, stride))
    rate = RATE / stride
    t = (np.arange(n) + 1) * stride / RATE - 1 / RATE
    ones = np.ones((n, 1))
    return FineSegment(
        0, "run1", None, 0.0, t, 0 * ones, ones, 0 * ones, ones, ones, ones if certain is None else certain,
        ones, rate, LowPass(CUTOFF, rate, 4), every // stride, np.ones(1),
    )  # fmt: skip


@pytest.mark.parametrize("N", [6000, 6037])
@pytest.mark.parametrize("stride", [1, 5])
def test_against_the_decimation_of_the_equations(N, stride):
    """Same instants and, up to what lies above the fine rate, the same values."""
    t = np.arange(N) / RATE
    x = np.column_stack([np.sin(2 * np.pi * 1.3 * t), np.tanh(np.cos(2 * np.pi * 0.4 * t) / 0.02), t])
    s = segment(N, stride)
    there = decimate(x, RATE, CUTOFF)
    here = s.decimate(x[stride - 1 :: stride])
    assert here.shape == there.shape == (s.rows, 3)
    inside = slice(4, -4)
    assert np.allclose(here[inside], there[inside], atol=2e-3 if stride > 1 else 2e-4)


def test_ones_stay_ones():
    s = segment(4000, 5)
    assert np.allclose(s.decimate(np.ones((len(s.t), 1))), 1.0)


def test_uncertain_samples_do_not_count():
    certain = np.ones((800, 1))
    certain[300:500] = 0.0
    s = segment(4000, 5, certain)
    out = s.decimate(np.ones((800, 1)), 0)[:, 0]
    assert out.min() < 1e-2 and np.allclose(out[[0, -1]], 1.0, atol=1e-3)


@pytest.mark.parametrize(("stride", "within"), [(2, 1e-4), (4, 2e-4), (5, 5e-4)])
def test_a_weight_that_falls_for_three_samples(stride, within):
    """A joint turns in milliseconds: what its rows lose there, columns of every second to fifth sample lose.
    The mean of an even stride that looks ahead loses it half a sample late (4 % of a row at 500 Hz)."""
    weight = np.ones((6000, 1))
    for turn in range(237, 6000, 731):
        weight[turn : turn + 3] = 0.0
    x = np.sin(2 * np.pi * 1.3 * np.arange(6000) / RATE)[:, None]
    s = segment(6000, stride, means_about(weight, np.arange(stride - 1, 6000, stride), stride))
    inside, there = slice(4, -4), decimate(weight * x, RATE, CUTOFF)
    assert np.allclose(s.decimate(x[stride - 1 :: stride], 0)[inside], there[inside], atol=within)


@pytest.mark.parametrize("step", [1, 2, 3, 4, 5])
def test_the_mean_of_a_step_is_that_of_its_own_instant(step):
    """A straight line has its own value as its mean over any step about an instant, whatever is left of the
    step near the ends; what one sample gives the means about all of them adds up to that sample."""
    line = 3.0 + 0.25 * np.arange(41.0)[:, None]
    kept = np.arange(0, 41, step)
    assert np.allclose(means_about(line, kept, step), line[kept], atol=1e-12)
    one = np.eye(41)[:, 20][:, None]
    assert np.isclose(means_about(one, np.arange(41), step).sum(), 1.0)


@pytest.mark.parametrize(("N", "every", "filter"), [
    (2003, 8, LowPass(10.0, 200.0, 4)), (60, 8, LowPass(10.0, 200.0, 4)), (13, 8, LowPass(10.0, 200.0, 4)),
    (5, 8, LowPass(10.0, 200.0, 4)), (700, 1, LowPass(20.0, 60.0, 4)), (3001, 250, LowPass(1.0, 100.0, 2)),
])  # fmt: skip
def test_frames_of_rows_are_the_convolution(N, every, filter):
    """Short and long stretches, more columns than are taken at a time, rows farther apart than the taps."""
    rng = np.random.default_rng(0)
    x, weight = rng.normal(size=(N, SIGNALS + 3)), rng.random(N)
    taps = _taps(filter)
    begin = len(taps) // 2 + every - 1
    whole = [np.convolve(column * weight, taps)[begin::every][: N // every] for column in x.T]
    assert np.allclose(_strided(filter, x, every, weight), np.stack(whole, axis=1), atol=1e-13)


@pytest.mark.parametrize("every", [1, 4, 40, 41, 80])
def test_the_stride_divides_and_leaves_the_rate(every):
    step = stride_of(every, RATE)
    assert every % step == 0 and (RATE / step >= FINE_HZ or step == 1)


@given(rate=st.floats(400.0, 5000.0), cutoff=st.floats(0.5, 6.0))
def test_rows_are_as_far_apart_as_leaves_few_fine_samples(rate, cutoff):
    """Of 1 kHz and 4.8 Hz 83 samples, a prime, were from row to row: a diagnosis took 2.6 times as long."""
    every = kept_every(cutoff, rate)
    assert abs(every - rate / (2.5 * cutoff)) <= 0.04 * every + 0.5
    assert 0.99 * FINE_HZ <= rate / stride_of(every, rate) < 2 * FINE_HZ


def test_fine_rows_are_the_rows_of_the_equations(clean_arm):
    """The model's own column of the rate, made again at the fine rate, is the equations' column."""
    state = clean_arm.state
    rows = state.rows
    joint = 1
    column = next(
        k for k, name in enumerate(state.model.parameters) if name.removesuffix("R") == f"Fvm{joint + 1}"
    )
    made = np.concatenate([s.decimate(s.dq[:, [joint]], joint)[:, 0] for s in state.segments])
    made *= rows.scale[joint]
    places, values = rows.base[joint]
    own = values[:, list(places).index(column)]
    use = rows.use[joint]
    assert np.linalg.norm((made - own)[use]) < 1e-3 * np.linalg.norm(own[use])


def test_back_gives_every_row_to_its_samples(clean_arm):
    state = clean_arm.state
    scene = Scene(state.rows, state.segments, tuple(s.motion for s in state.segments), state.model)
    number = np.arange(float(len(state.rows.t)))
    back = scene.back(0, number, np.ones(len(number), bool))
    assert [len(b) for b in back] == [len(s.t) for s in state.segments]
    s = state.segments[0]
    assert np.array_equal(back[0][: 3 * s.every], np.repeat([0.0, 1.0, 2.0], s.every))
