"""Every check of one table, one after the other."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ident.examination import repeats
from ident.examination.check import Check
from ident.examination.excerpt import Excerpt
from ident.examination.samples import Mender
from ident.examination.signals import (
    Columns,
    dead_and_resting,
    flags,
    limits_hit,
    lost_samples,
    position_steps,
    units,
    wraps,
)


def of_table(
    columns: Columns, mender: Mender, excerpt: Excerpt, lowest: np.ndarray, highest: np.ndarray, rows: int
) -> Iterable[Check]:
    """Every check of one table."""
    said, slow = repeats.held(columns, excerpt)
    yield from lost_samples(columns, mender, rows)
    yield from wraps(columns, mender)
    yield from units(columns, lowest, highest)
    yield from position_steps(columns, mender)
    yield from dead_and_resting(columns, lowest, highest)
    yield from flags(columns, excerpt)
    yield from limits_hit(columns, excerpt, slow)
    yield from said
    yield from repeats.copies(columns, excerpt)
    lost = sum((c for kind, c in mender.counts.items() if kind != "spike"), np.zeros(len(columns.signals)))
    gone = {int(k) for k in np.flatnonzero(lost >= repeats.STILL_ROWS)}  # interpolated, so they stand still
    yield from repeats.standing(columns, excerpt, slow | gone)
    yield from repeats.unsigned(columns, excerpt)
    yield from repeats.coarse(columns, excerpt, slow)
