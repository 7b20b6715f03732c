"""A torque that leaps from one row to the next and stays there while its joint goes on.

What inertia, weight and friction ask for of joints that go on in their directions goes on, too. What leaps by
far more than around it, for good, is another zero or a load. (Of a Barrett whose second torque leaps by two
of its deviations in the middle of each run half of it was left, and nothing was said.)
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import pairwise

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.mending import STEP
from ident.examination.tables.signals import Columns
from ident.examination.tables.spikes import median_of_four

AROUND, BESIDE = 25, 8  # rows on either side: of what a torque does else, and in which no joint turns
KEPT = 0.5  # of a leap, by which the torque is still away that many rows behind it
LATE = 0.25  # s: torques that come later than their positions, or earlier, by more are told by others
MOST = 3  # leaps of a torque: more are its steps
SHARE = 0.1  # of what a joint goes in as many rows at most, with which it goes on; of a torque's range


def torque_leaps(columns: Columns, excerpt: Excerpt) -> Iterator[Check]:
    """One check of all that leap."""
    found: dict[int, list[tuple[int, float, float]]] = {}
    for rows, t, values in excerpt.pieces:
        if len(t) < 4 * AROUND or not (np.diff(t) > 0).all():
            continue
        even = np.diff(t) < 2 * np.median(np.diff(t))
        for at, c in _leaps(values[:, columns.n :].T):
            k = columns.n + c
            near, joint = slice(max(at - BESIDE, 0), at + BESIDE + 1), int(columns.joint[k])
            size = float(values[at + 1, k] - values[at, k])
            goes_on = even[near].all() and _goes_on(values[:, : columns.n], at, joint)
            if goes_on and not _turns_late(t, values[:, joint], at, size):
                found.setdefault(k, []).append((int(rows[at + 1]) + 1, float(t[at + 1]), size))
    its = {k: leaps for k, leaps in found.items() if len(leaps) <= MOST and not _back([x for *_, x in leaps])}
    if not its:
        return
    names = tuple(columns.signals[k] for k in its)
    each = [
        f"{columns.signals[k]} leaps by {listed(f'{size:.3g} at {t:.3g} s' for _, t, size in leaps)}"
        for k, leaps in its.items()
    ]
    every = [row for leaps in its.values() for row, _, _ in leaps]
    yield Check(
        "torque_step",
        names,
        f"{'; '.join(each)} from one row to the next and stays there, while its joint goes on: another zero, "
        "sign or unit from there on, a load or a contact that comes or goes at once",
        "use the part before or after it with from: and to:",
        rows=(min(every), max(every)),
        hint=True,
    )


def _back(sizes: list[float]) -> bool:
    """Whether a leap is undone by the next one, as friction does where the position is another joint's."""
    return any(abs(a + b) < KEPT * max(abs(a), abs(b)) for a, b in pairwise(sizes))


def _leaps(x: np.ndarray) -> list[tuple[int, int]]:
    """Rows of torques (C, N) behind which one leaps, and stays, and which one does."""
    d = np.diff(x, axis=1)
    around = np.pad(d, ((0, 0), (2, 2)), mode="edge")
    off = np.abs(d - median_of_four(around[:, :-4], around[:, 1:-3], around[:, 3:-1], around[:, 4:]))
    inner, most = off[:, AROUND:-AROUND], np.zeros(1)
    for k in (2, -2, 3, -3, 4, -4, 5, -5):
        most = np.maximum(most, off[:, AROUND + k : off.shape[1] - AROUND + k])
    out, least = [], cache(lambda c: _least(x[c], off[c]))
    for at, c in np.argwhere((inner > STEP * most).T).tolist():
        at += AROUND
        near = max(off[c, at - AROUND : at - 1].max(), off[c, at + 2 : at + AROUND + 1].max())
        if not off[c, at] > max(STEP * near, least(c)):
            continue
        before, after = x[c, at - BESIDE : at + 1], x[c, at + 1 : at + 2 + BESIDE]
        held = (np.diff(before) == 0).any() or (np.diff(after) == 0).any()
        stays = (np.median(after) - np.median(before)) * np.sign(d[c, at]) > KEPT * abs(d[c, at])
        if stays and not held:
            out.append((at, c))
    return out


def _least(x: np.ndarray, off: np.ndarray) -> float:
    """What a leap is larger than: beside the torque's range, and what it leaps by elsewhere."""
    low, high = np.quantile(x, [0.05, 0.95])
    return float(max(STEP * np.quantile(off, 0.9), SHARE * (high - low)))


def _goes_on(q: np.ndarray, at: int, joint: int) -> bool:
    """Whether a joint goes on about a row in its direction, and no other one turns there."""
    before, after = q[at + 1] - q[at - BESIDE], q[at + 1 + BESIDE] - q[at + 1]
    most = np.abs(q[BESIDE:] - q[:-BESIDE]).max(axis=0)
    moves = np.minimum(np.abs(before), np.abs(after)) > SHARE * most
    turns = (np.sign(before) != np.sign(after)) & (np.maximum(np.abs(before), np.abs(after)) > SHARE * most)
    return bool(moves[joint] and not turns.any())


def _turns_late(t: np.ndarray, q: np.ndarray, at: int, size: float) -> bool:
    """Whether a joint turns a little before or after a leap of its torque, in the leap's sense: dry friction
    of a torque that comes late. (Of a slide whose force is 0.1 s late a load that comes at once was told.)"""
    first, last = np.searchsorted(t, [t[at] - LATE, t[at] + LATE])
    least = SHARE * np.abs(q[BESIDE:] - q[:-BESIDE]).max()
    along = np.sign(size) * q
    each = along[max(first - BESIDE, 0) : at + 2], along[at + 1 : last + BESIDE]
    return any(min(x[0], x[-1]) - x.min() > least for x in each)
