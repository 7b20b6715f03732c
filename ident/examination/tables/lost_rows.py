"""Rows that were lost while the stamps go on as if none were: all positions go on by some rows at once.

From row to row the positions of smooth motion go on as their four neighbours do; where rows are gone they go
on by a whole number of times that, all of them by the same. How far joints go on otherwise elsewhere in the
log says how much of that is none. (Of a Franka at 50 Hz without two rows in a run nothing was said: errors of
2 to 3 % were 5 to 12; of a Barrett without eight, which was told, that something acted on it meanwhile.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.tables.excerpt import Excerpt

WHOLE, ONE = 0.3, 0.1  # from a whole number of rows; share of what is left when so many are taken as gone
ALONE = 10.0  # times what any other row leaves
APART = 3  # rows from which on a row is another


@dataclass(frozen=True, slots=True)
class LostRows:
    """Rows of the table (K,), from 0, before which so many (K,) are missing, and how long a row takes [s]."""

    rows: tuple[int, ...]
    counts: tuple[int, ...]
    step: float

    def later(self, rows: np.ndarray) -> np.ndarray:
        """(N,) [s] by how much rows (N,) were taken later than their stamps say."""
        gone = np.concatenate([[0], np.cumsum(self.counts)])
        return np.asarray(self.step * gone[np.searchsorted(self.rows, rows, side="right")])

    def check(self, recording: str) -> Check:
        gone, rows = sum(self.counts), [row + 1 for row in self.rows]
        return Check(
            "lost_rows",
            ("t",),
            f"all positions go on by {listed(count + 1 for count in self.counts)} rows at once before row "
            f"{listed(rows)}, and the stamps by one: {gone} row{'s are' if gone > 1 else ' is'} missing "
            "there; what follows was put as much later",
            "export the log with its own stamps",
            outcome="mended",
            recording=recording,
            rows=(rows[0], rows[-1]),
        )


def lost_rows(excerpt: Excerpt, joints: int) -> LostRows | None:
    """Rows that are missing; None where none are."""
    if joints < 2:
        return None
    found: list[tuple[int, int]] = []
    pace = 0.0
    for rows, t, values in excerpt.pieces:
        step = np.diff(t)
        if len(t) < 50 or not (step > 0).all() or np.ptp(rows) != len(rows) - 1:
            continue
        pace = float(np.median(step))
        rate = np.diff(values[:, :joints], axis=0) / step[:, None]
        before, after, here = 0.5 * (rate[:-4] + rate[1:-3]), 0.5 * (rate[3:-1] + rate[4:]), rate[2:-2]
        around = 0.5 * (before + after)
        usual = np.median(np.abs(here - around), axis=0) + 1e-3 * np.std(rate, axis=0) + _least(rate)
        before, after, around, here = (x / usual for x in (before, after, around, here))
        moves = (around**2).sum(axis=1)
        times, *sides = (_times(here, x) for x in (around, before, after))
        left, so = ((here - x * around) for x in (1.0, times[:, None]))
        left, so = (left**2).sum(axis=1), (so**2).sum(axis=1)
        whole = (times > 1.5) & (np.abs(times - np.rint(times)) < WHOLE) & (so < ONE * left)
        whole &= moves > (3 / WHOLE) ** 2  # by which the number is known
        repeats = np.convolve((rate == 0).all(axis=1), np.ones(2 * APART + 1), "same") > 0.5
        whole &= ~repeats[2:-2]  # which come late, and are made up for: none is missing in sum
        whole &= np.minimum(*sides) > 1.5  # behind the last row before it is frozen none goes on
        beside = np.convolve(whole, np.ones(2 * APART + 1), "same") > 0.5
        least = ALONE * left[~beside].max(initial=0.0) if (~beside).any() else np.inf
        found += [
            (int(rows[k + 3]), round(float(times[k])) - 1) for k in np.flatnonzero(whole & (left > least))
        ]
    gone = sorted(found)
    return LostRows(tuple(row for row, _ in gone), tuple(count for _, count in gone), pace) if gone else None


def _least(rate: np.ndarray) -> np.ndarray:
    """(n,) what a rate (N, n) changes by in one step of its position. (A rokae's second joint that stood
    still but for single steps of 0.1 mrad went on by twice what is around each of them.)"""
    moving = np.where(rate != 0, np.abs(rate), np.nan)
    return np.array([np.nanquantile(x, 0.02) if np.isfinite(x).any() else 1e-300 for x in moving.T])


def _times(here: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(N,) how many times others (N, n) the rates here (N, n) are."""
    return np.asarray((here * others).sum(axis=1) / np.maximum((others**2).sum(axis=1), 1e-300))
