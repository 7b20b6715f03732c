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
    edges = np.linspace(0, len(t), stretches + 1).astype(int)
    keep: list[int] = []
    for start, stop in zip(edges[:-1], edges[1:], strict=True):
        part = y[start:stop]
        finite = np.flatnonzero(np.isfinite(part))
        if not len(finite):
            keep.append(int(start))
            continue
        low, high = finite[np.argmin(part[finite])], finite[np.argmax(part[finite])]
        keep += sorted({int(start + low), int(start + high)})
        gap = np.flatnonzero(~np.isfinite(part))
        if len(gap):
            keep.append(int(start + gap[0]))
    order = np.unique(keep)
    return t[order], y[order]


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
