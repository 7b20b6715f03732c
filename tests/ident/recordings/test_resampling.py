"""Jittered samples on a uniform grid: exact for cubics, indifferent to how the log is cut into blocks."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ident.recordings.resampling import cubic_at, resample


def jittered(n, seed):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(0.5, 1.5, n)) * 0.01


@given(st.integers(4, 200), st.integers(0, 1000))
def test_cubics_are_exact(n, seed):
    t = jittered(n, seed)
    values = np.column_stack([t**3 - t, np.ones(n)])
    at = np.linspace(t[0], t[-1], 57)
    assert np.allclose(
        cubic_at(t, values, at), np.column_stack([at**3 - at, np.ones(57)]), atol=1e-9 * max(1, t[-1] ** 3)
    )


@given(st.lists(st.integers(1, 60), min_size=1, max_size=10), st.integers(0, 1000))
@settings(deadline=None)
def test_blocks_do_not_show(sizes, seed):
    t = jittered(sum(sizes) + 8, seed)
    values = np.sin(t)[:, None]
    cuts = np.cumsum(sizes)
    pieces = list(zip(np.split(t, cuts), np.split(values, cuts)))
    whole = np.concatenate(list(resample([(t, values)], 80.0)))
    cut = np.concatenate(list(resample(pieces, 80.0)))
    assert cut.shape == whole.shape
    assert np.allclose(
        cut, whole, atol=2e-6
    )  # near a cut the last two points may use the other four neighbours
