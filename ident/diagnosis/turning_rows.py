"""Rows that see their joint turn round.

What friction does while a joint turns is known to a model's widths and no better, and what is wrong there
looks like a torque that comes at another time. A shift in time is a shift of all of the torque: it must show
where no joint turns, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence import Metric, metric
from ident.diagnosis.state import State

TURNED = 0.99  # of the sign that friction takes: below it has not turned over yet


def without_turning(state: State, m: Metric) -> Metric:
    """The metric `m` on the rows of each channel in which its own joint keeps its direction, one row apart
    from those in which it does not."""
    rows = state.rows
    beside = []
    for c, use in enumerate(rows.use):
        j = state.model.channels[c].joint
        turning = np.concatenate([_turning(s.sign_dq[:, j], s.rows, s.every) for s in state.segments])
        beside.append(use & ~turning)
    design, B = state.design
    return metric(replace(rows, use=np.array(beside)), design, B, m.whiteners)


def _turning(sign: np.ndarray, rows: int, every: int) -> np.ndarray:
    """(rows,) bool."""
    here = (np.abs(sign[: rows * every]) < TURNED).reshape(rows, every).any(axis=1)
    flips = np.diff(np.sign(sign[: rows * every : every]), prepend=np.sign(sign[:1])) != 0
    here |= flips
    wide = here.copy()
    wide[1:] |= here[:-1]
    wide[:-1] |= here[1:]
    return wide
