"""A position that stands still from one row to the next while other joints go on.

A joint is brought to rest by a torque, and its rate changes then as it does elsewhere. One whose rate is gone
within a row, many times faster than it ever changes else, is an encoder or a message that stopped, whatever
its logged velocity says. (Of a Franka's first joint, a TX40's fourth and a UR10e's third that stopped in half
of each run nothing was said: short stretches of other torques do not tell it.)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ident.examination.check import Check
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.repeats import STILL_ROWS, STILL_S, TRAVELLED
from ident.examination.tables.signals import Columns
from ident.signals.runs import runs_of_equals

ROWS = (1, 2, 4, 8, 16)  # over which rates are taken: of a fine encoder few, of a coarse one more
TIMES = 3.0  # what a rate changes by elsewhere
KEPT = 0.4  # of the way over twice as many rows: a half at one pace, a quarter of what is brought to rest


def stopped_at_once(columns: Columns, excerpt: Excerpt, held: set[int]) -> Iterator[Check]:
    """held: columns that change every so many rows only, or were filled in."""
    for k in set(range(columns.n)) - held:
        pieces = [block for block in excerpt.stretches(k, k) if len(block[0]) > 2 * ROWS[-1] + STILL_ROWS]
        stops = [(piece, begin, end) for piece in pieces for begin, end in _still(piece[1], piece[2][:, 0])]
        for (rows, t, x), begin, end in stops:
            if _at_once(pieces, rows, x[:, 0], begin, end) and _others_go_on(
                columns, excerpt, k, rows[begin], rows[end]
            ):
                name = columns.signals[k]
                yield Check(
                    "dead_channel",
                    (name,),
                    f"{name} stands still from {t[begin]:.3g} s to {t[end]:.3g} s, at once, while other "
                    "joints move: an encoder or a message that stopped, a value held (or a brake that closed "
                    f"within {1e3 * (t[begin] - t[begin - 1]):.2g} ms)",
                    "leave the stretch out with from: and to:",
                    rows=(int(rows[begin]) + 1, int(rows[end]) + 1),
                )
                break


def _at_once(pieces: list, rows: np.ndarray, x: np.ndarray, begin: int, end: int) -> bool:
    """Whether a position goes on at its pace up to where it stands, wherever that can be told."""
    for w in ROWS:
        if 2 * w > begin:
            return False
        near, far = abs(x[begin - w] - x[begin]), abs(x[begin - 2 * w] - x[begin])
        one, two = (_most(pieces, k, int(rows[begin]), int(rows[end])) for k in (w, 2 * w))
        if far > TIMES * two and near < KEPT * far:
            return False
        if near > TIMES * one > 0:
            return True
    return False


def _still(t: np.ndarray, x: np.ndarray) -> list[tuple[int, int]]:
    """First and last place of the runs of equal values that are long."""
    begin, length = runs_of_equals(x)
    end = begin + length - 1
    long = (begin > 0) & (length > STILL_ROWS) & (t[end] - t[begin] > STILL_S)
    return list(zip(begin[long].tolist(), end[long].tolist()))


def _most(pieces: list, w: int, begin: int, end: int) -> float:
    """By how much a position's way over w rows differs from that over the w rows before, at most, but for
    where these rows of the table begin and end."""
    most = 0.0
    for rows, _, x in pieces:
        turn = np.abs(x[2 * w :, 0] - 2 * x[w:-w, 0] + x[: -2 * w, 0])
        near = np.minimum(np.abs(rows[w:-w] - begin), np.abs(rows[w:-w] - end - 1)) <= w
        most = max(most, float(turn[~near].max(initial=0.0)))
    return most


def _others_go_on(columns: Columns, excerpt: Excerpt, k: int, begin: int, end: int) -> bool:
    """Whether another joint travels meanwhile."""
    reach = np.zeros(columns.n)
    for rows, _, values in excerpt.pieces:
        inside = values[(rows >= begin) & (rows <= end), : columns.n]
        if len(inside):
            reach = np.maximum(reach, np.ptp(inside, axis=0))
    return bool(np.delete(reach, k).max(initial=0.0) > TRAVELLED)
