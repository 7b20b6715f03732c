"""Rows that share a stamp, or follow it in a burst, spread evenly up to the next one.

That a uniform clock is no further from stamps than their longest step does not make it the samples'. Between
one burst and the next a few rows are spread by the stamps themselves, and where the spread rows' steps differ
the motion tells whether the samples' do. (Of a UR10e, the clock of whose driver wanders by two samples, with
each stamp in two rows the nearest uniform clock was used, and 6.6 % left for 4.9.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.uneven_stamps import CLEAR, followed

BURST = 0.3  # of the mean step: what is closer shares a stamp
KEPT = 2_000_000  # stamps of their own, beyond which they are not held


@dataclass(frozen=True, slots=True)
class Spread:
    """Rows (K,) of the table that have stamps (K,) [s] of their own, on a line between them."""

    rows: np.ndarray
    stamps: np.ndarray

    def of(self, rows: np.ndarray) -> np.ndarray:
        """When rows (N,) were taken [s]; before the first stamp and behind the last one at the mean pace."""
        step = (self.stamps[-1] - self.stamps[0]) / (self.rows[-1] - self.rows[0])
        off = np.minimum(rows - self.rows[0], 0) + np.maximum(rows - self.rows[-1], 0)
        return np.asarray(np.interp(rows, self.rows, self.stamps) + off * step)

    def is_followed(self, excerpt: Excerpt, joints: int) -> bool:
        """Whether joints go by the spread stamps' steps rather than by even ones, but for chance: by
        all that these differ, not by nothing, nor by many times as much, as if they differed by rounding."""
        spread = Excerpt()
        spread.pieces = [(rows, self.of(rows), values) for rows, _, values in excerpt.pieces]
        its = followed(spread, joints)
        return its is not None and 0.5 < its.share - CLEAR * its.spread < 1.5


def spread(stamps: Callable[[], Iterable[np.ndarray]]) -> Spread | None:
    """The first row of every burst of stamps [s], which are read twice; None where they are too many."""
    first, last, count = None, 0.0, 0
    for t in stamps():
        first = t[0] if first is None and len(t) else first
        last, count = (float(t[-1]) if len(t) else last), count + len(t)
    if first is None or count < 2 or not last > first:
        return None
    least, rows, own, row, before = BURST * (last - first) / (count - 1), [], [], 0, -np.inf
    for t in stamps():
        new = np.flatnonzero(np.diff(t, prepend=before) > least)
        rows.append(row + new)
        own.append(t[new])
        row, before = row + len(t), t[-1] if len(t) else before
        if sum(map(len, rows)) > KEPT:
            return None
    its = Spread(np.concatenate(rows), np.concatenate(own))
    return its if len(its.rows) > 1 else None


def spread_stamps(recording: str, shared: int, rows: int) -> Check:
    """Said of rows so spread."""
    return Check(
        "time_stamps",
        ("t",),
        f"{shared} of {rows} rows share a stamp with the row before or follow it in a burst; they were "
        "spread evenly up to the next stamp, as joints go more by these than by a uniform clock",
        "record the stamps where the samples are taken",
        "mended",
        recording,
        (1, rows),
    )
