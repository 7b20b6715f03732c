"""Long time series made small without hiding a peak: the least and greatest sample of every stretch."""

import numpy as np
from numpy.typing import NDArray


def envelope(
    t: NDArray[np.float64], y: NDArray[np.float64], stretches: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The lowest and highest sample of each of at most `stretches` equal stretches, in order of time.

    Shapes: t, y (N,) -> t, y (M,), M <= 2 stretches; a series of that length or shorter comes back whole.
    A stretch without a finite sample gives one NaN, so that a gap stays a gap. Every returned sample is a
    sample of the input and the extremes of the whole series are among them.
    """
    if len(t) <= 2 * stretches:
        return t, y
    length = -(-len(t) // stretches)
    rows = -(-len(t) // length)
    padded = np.full(rows * length, np.nan)
    padded[: len(y)] = y
    table = padded.reshape(rows, length)
    missing = ~np.isfinite(table)
    first = np.arange(rows) * length
    low = first + np.argmin(np.where(missing, np.inf, table), axis=1)
    high = first + np.argmax(np.where(missing, -np.inf, table), axis=1)
    gaps = first[missing.any(axis=1)] + np.argmax(missing[missing.any(axis=1)], axis=1)
    kept = np.zeros(len(t), bool)
    for its in (low, high, gaps[gaps < len(t)]):
        kept[its] = True
    return t[kept], y[kept]


def stretches_for(traces: int, budget_bytes: int = 2_400_000) -> int:
    """How many stretches each of `traces` time series may have so that all fit the budget.

    A stretch holds two samples of two float32 in base64, 22 bytes; between 120 and 1500 are used.
    """
    return int(np.clip(budget_bytes // (22 * max(traces, 1)), 120, 1500))


def with_gaps(
    t: NDArray[np.float64], y: NDArray[np.float64], factor: float = 3.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Put a NaN where t jumps by more than `factor` usual steps, so that no line bridges a gap."""
    if len(t) < 3:
        return t, y
    step = np.diff(t)
    jumps = np.flatnonzero((step > factor * np.median(step)) | (step < 0)) + 1
    return np.insert(t, jumps, t[jumps - 1]), np.insert(y, jumps, np.nan)
