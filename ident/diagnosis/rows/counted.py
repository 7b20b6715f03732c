"""Which samples of a torque the rows of the diagnosis count."""

from __future__ import annotations

import numpy as np

from ident.diagnosis.rows.rows import Rows
from ident.equations.comparison import Curves


def counted(rows: Rows, curve: Curves, c: int) -> np.ndarray:
    """(m,) bool: samples of a channel's curve whose row and the rows beside it are used. Those at rest are
    not: there friction is anything, and so is the place of a gear in its play."""
    own = np.flatnonzero(rows.recording == rows.names.index(curve.label))
    t, use = rows.t[own], rows.use[c, own]
    nearest = np.clip(np.searchsorted(t, np.nan_to_num(curve.t) - rows.hop / 2), 0, len(t) - 1)
    beside = [use[np.clip(nearest + k, 0, len(t) - 1)] for k in (-1, 0, 1)]
    return (np.abs(t[nearest] - curve.t) <= rows.hop) & np.all(beside, axis=0)
