"""What a load gains with one edge of its window at each of some instants.

From one instant to the next the columns change between the two alone. So products are made once of the part
of the window that all have, and of what lies between neighbours, of the few rows that feel it; those of any
window are sums of these (the numbers are those of columns cut and whitened anew for every instant)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from ident.diagnosis.evidence.metric import Columns, Metric, project
from ident.diagnosis.evidence.refine import solution


def gains_with_edge(
    m: Metric, columns: Columns, t: np.ndarray, cuts: np.ndarray, other: float, begins: bool
) -> np.ndarray:
    """(K,) half the fall of the whitened sum of squares, of the columns in a window from each of the cuts
    (K,), ascending, to the `other` edge, where it begins there, or from that to each of them. The rows of `m`
    are at the times t (M,), and its whiteners take nothing up."""
    between = list(pairwise(cuts))
    common = (cuts[-1], other) if begins else (other, cuts[0])
    if begins:
        between.reverse()
    within = [(t >= a) & (t < b) for a, b in (common, *between)]
    base = m.whiten({c: z * within[0][:, None] for c, z in columns.items()})
    cross, own, right = (part[None] for part in project(m, m.fitted, base))
    if between:
        near = _near(m, np.flatnonzero(np.any(within[1:], axis=0)))
        more = _between(m.only(near), columns, base, near, np.array(within[1:])[:, near])
        cross, own, right = (
            np.concatenate([one, one + rest]) for one, rest in zip((cross, own, right), more)
        )
    told = np.array([solution(g - x.T @ x, h)[1] for x, g, h in zip(cross, own, right)])
    return told[::-1] if begins else told


def _between(
    m: Metric, columns: Columns, base: Mapping[int, np.ndarray], near: np.ndarray, within: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the parts `within` (K, M) add, one after the other, to the products of the base: with the model
    (K, r, p), own (K, p, p), with the residual (K, p)."""
    K, p = len(within), next(iter(columns.values())).shape[1]
    parts = {
        c: (z[near, None, :] * within.T[:, :, None]).reshape(len(near), K * p) for c, z in columns.items()
    }
    white = m.whiten(parts)
    cross, own, right = project(m, m.fitted, white)
    mixed = np.zeros((p, K * p))
    for c, z in white.items():
        mixed += (base[c][near] * (m.fitted.mask & m.rows.use[c])[:, None]).T @ z
    each = np.arange(K)
    among = own.reshape(K, p, K, p).cumsum(axis=0).cumsum(axis=2)[each, :, each, :]
    beside = mixed.reshape(p, K, p).cumsum(axis=1).transpose(1, 0, 2)
    cross = cross.reshape(-1, K, p).cumsum(axis=1).transpose(1, 0, 2)
    return cross, among + beside + beside.transpose(0, 2, 1), right.reshape(K, p).cumsum(axis=0)


def _near(m: Metric, rows: np.ndarray) -> np.ndarray:
    """(k,) the rows and those that follow as far as a whitener remembers."""
    if not len(rows):
        return rows
    reach = max(len(w.covariance) for w in m.whiteners)
    return np.arange(rows[0], min(rows[-1] + reach + 1, len(m.rows.t)))
