"""Every check of one table, one after the other."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain

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
) -> list[Check]:
    """Every check of one table, with the recording's name."""
    said, slow = repeats.held(columns, excerpt)
    lost = sum((c for kind, c in mender.counts.items() if kind != "spike"), np.zeros(len(columns.signals)))
    gone = {int(k) for k in np.flatnonzero(lost >= repeats.STILL_ROWS)}  # interpolated, so they stand still
    found = chain(
        lost_samples(columns, mender, rows),
        wraps(columns, mender),
        units(columns, mender, lowest, highest),
        position_steps(columns, mender),
        dead_and_resting(columns, lowest, highest),
        flags(columns, excerpt),
        limits_hit(columns, excerpt, slow),
        said,
        repeats.copies(columns, excerpt),
        repeats.standing(columns, excerpt, slow | gone),
        repeats.noise_alone(columns, excerpt),
        repeats.unsigned(columns, excerpt),
        repeats.coarse(columns, excerpt, slow),
    )
    return [replace(check, recording=columns.recording) for check in found]
