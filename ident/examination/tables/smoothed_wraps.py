"""A position that wraps and was smoothed or resampled over its leaps: it turns once within moments.

A leap from one row to the next is undone. What a filter or an interpolation made of one has rows in between,
which are no position at all. No arm turns once within a tenth of a second from hardly moving to hardly
moving, and what wraps keeps within a turn. (Of an AIRBOT's third position, smoothed over five rows, 57 % of
the torques were left, and nothing was said; beside its velocity that it was another joint's.)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ident.examination.check import Check
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.mending import NEAR
from ident.examination.tables.signals import Columns

ROWS = (2, 4, 8, 16, 32, 64)  # that a leap is spread over
MOST_S = 0.1
TURN = 2 * np.pi


def smoothed_wraps(columns: Columns, excerpt: Excerpt) -> Iterator[Check]:
    for k in range(columns.n):
        reach = np.ptp(excerpt.column(k))
        if columns.prismatic[k] or not TURN - NEAR < reach < TURN + NEAR:
            continue
        found = [its for piece in excerpt.stretches(k, k) for its in _turning(*piece)]
        if not found:
            continue
        name, (first, _, seconds), more = columns.signals[k], found[0], len(found) > 1
        yield Check(
            "wrap",
            (name,),
            f"{name} goes by a whole turn within {1e3 * seconds:.2g} ms"
            f"{f', {len(found)} times' if more else ''} ({'first ' if more else ''}in row {first + 1}): it "
            "wraps, and was smoothed or resampled over its leaps",
            "log it without wraps, or take them out before anything else is done to it",
            outcome="refused",
            rows=(first + 1, found[-1][1] + 1),
        )


def _turning(rows: np.ndarray, t: np.ndarray, x: np.ndarray) -> list[tuple[int, int, float]]:
    """First and last row of each such turn, and its time [s], over as few rows as show any."""
    x = x[:, 0]
    for w in ROWS:
        if len(x) <= 3 * w:
            break
        moves, took = x[w:] - x[:-w], t[2 * w : -w] - t[w : -2 * w]
        before, over, after = moves[: -2 * w], moves[w:-w], moves[2 * w :]
        slow = np.maximum(np.abs(before), np.abs(after)) < NEAR
        turns = slow & (np.abs(np.abs(over - 0.5 * (before + after)) - TURN) < NEAR) & (took < MOST_S)
        at = np.flatnonzero(turns) + w
        if len(at):
            own = np.split(at, np.flatnonzero(np.diff(at) > w) + 1)
            middles = [its[len(its) // 2] for its in own]
            return [(int(rows[m]), int(rows[m + w]), float(t[m + w] - t[m])) for m in middles]
    return []
