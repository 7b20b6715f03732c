"""Stamps whose steps are not those of the motion: rounded to about a sample's length, or taken late.

Where rows were lost a joint goes on meanwhile, and so much further in a longer step of the stamps. Where it
goes as far in long steps as in short ones the samples are even, and rates from row to row by such stamps are
wrong. (A UR10e's stamps, 10 and 12 ms apart and rounded to 10 ms, are 10 and 20 ms apart: a third of all
torques was then unexplained, and nothing was said.)

A program that stamps what it receives scatters by less; whose stamps those are the motion tells as well: of
what the steps differ by joints go further in the longer ones by all, 1.00 of it with a UR10e and 1.00 with a
Franka, or by nothing, 0.000 of 1 % with an LWR4+.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check
from ident.examination.tables.clock import BURSTS, LONG, PAUSE
from ident.examination.tables.excerpt import Excerpt

SIDE = 8  # rows on either side that tell how fast joints go
BLOCKS, CLEAR = 20, 3.0  # of rows that tell how well a share is known, and of its standard deviations
FEWEST = 25  # long steps: how far joints go in them is then known to a seventh, a third of what is asked


def uneven_steps(excerpt: Excerpt, joints: int) -> str:
    """In words where at least one step in twenty is long beside those around it and positions, the first so
    many columns, go in these less than half of what they have to go beyond what they go in the others;
    nothing elsewhere. (Of logs that hold a row where something changed, or change their rate, steps are long
    where joints are slow, or all of them: of three arms' the stamps were told to be rounded.)"""
    long, usual = (np.zeros(5) for _ in range(2))  # steps, s, what is usual there, joints go, have to evenly
    for _, t, values in excerpt.pieces:
        on = np.diff(t)
        if len(t) < 4 * SIDE or not (on > 0).any():
            continue
        middle = np.median(np.lib.stride_tricks.sliding_window_view(on, 2 * SIDE + 1), axis=1)
        (dt, went), (_, pace) = _steps(t, values[:, :joints])
        gone, evenly = (went * pace).sum(axis=1), (pace * pace).sum(axis=1)
        each = np.stack([np.ones(len(dt)), dt, middle, gone, evenly])
        far = dt > LONG * middle
        long += each[:, far & (dt < PAUSE * middle)].sum(axis=1)
        usual += each[:, ~far & (dt > 0)].sum(axis=1)
    if long[0] < max(FEWEST, BURSTS * (long[0] + usual[0])) or not min(*long[2:], *usual[2:]) > 0:
        return ""
    steps, share = (long[1] / long[0], usual[1] / usual[0]), long[0] / (long[0] + usual[0])
    further = (long[3] / long[4]) / (usual[3] / usual[4])
    if not further - 1 < 0.5 * ((long[1] / long[2]) / (usual[1] / usual[2]) - 1):
        return ""
    return (
        f"{100 * share:.0f} % of the steps of t are {1e3 * steps[0]:.3g} ms, the others "
        f"{1e3 * steps[1]:.3g} ms, though joints go {further:.2f} times as far in them"
    )


@dataclass(frozen=True, slots=True)
class Followed:
    """By how much of what the steps of stamps differ by joints go further in the longer ones, its standard
    deviation, and how much these differ."""

    share: float
    spread: float
    scatter: float


def even_samples(excerpt: Excerpt, joints: int) -> str:
    """In words where joints go, but for chance, by less than half of what the steps differ by further in the
    longer of them: the samples are nearer to a uniform clock than to their stamps. Nothing elsewhere."""
    its = followed(excerpt, joints)
    if its is None or not its.share + CLEAR * its.spread < 0.5:
        return ""
    return f"the steps of t scatter by {100 * its.scatter:.2g} %, and joints go as if none did"


def followed(excerpt: Excerpt, joints: int) -> Followed | None:
    """None where no stamps differ, or nothing moves."""
    steps, pairs = [], []
    for _, t, values in excerpt.pieces:
        if len(t) < 4 * SIDE or not (np.diff(t) > 0).all():
            continue
        (dt, went), (mean, pace) = _steps(t, values[:, :joints])
        longer, on = dt / mean - 1, np.diff(t)
        lost = np.concatenate([[0], np.cumsum(on > LONG * np.median(on))])  # joints go on there meanwhile
        usual = lost[2 * SIDE + 1 :] == lost[: -2 * SIDE - 1]
        steps.append(longer[usual])
        pairs.append(((pace * longer[:, None])[usual], (went - pace)[usual]))
    if not sum(map(len, steps)):
        return None
    asked, gone = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    weight = 1.0 / np.maximum(gone.var(axis=0), 1e-300)
    parts = np.array_split(np.arange(len(asked)), BLOCKS)
    own = np.array([((asked[rows] ** 2) @ weight).sum() for rows in parts])
    both = np.array([((asked[rows] * gone[rows]) @ weight).sum() for rows in parts])
    if not own.sum() > 0:
        return None
    share = both.sum() / own.sum()
    spread = np.sqrt(((both - share * own) ** 2).sum()) / own.sum()
    return Followed(float(share), float(spread), float(np.std(np.concatenate(steps))))


def _steps(t: np.ndarray, q: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """From row to row what stamps (N,) and positions (N, n) go on by, and what they would in even steps from
    SIDE rows before to as many behind; of all rows that have these."""

    def each(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        gone = np.diff(x, axis=0)[SIDE : len(x) - 1 - SIDE]
        return gone, (x[2 * SIDE + 1 :] - x[: -2 * SIDE - 1]) / (2 * SIDE + 1)

    (dt, mean), (went, pace) = each(t), each(q)
    return (dt, went), (mean, pace)


def scattering_stamps(recording: str, steps: str) -> Check:
    """Stamps that scatter about even samples, with no uniform clock behind them: rows are missing, or the
    samples are not quite even."""
    return Check(
        "time_stamps",
        ("t",),
        f"{steps}: they were taken late, no uniform clock was found behind them (rows are missing, or the "
        "clock wanders), and rates are off by as much from one row to the next",
        "record the stamps where the samples are taken",
        recording=recording,
    )


def uneven_stamps(recording: str, steps: str) -> Check:
    """Such stamps, with no uniform clock behind them: rows may be missing, too, which no rate puts back. (Of
    an LWR4+ whose log pauses for 5 s the stamps were to be left out.)"""
    return Check(
        "time_stamps",
        ("t",),
        f"{steps}: the stamps are rounded, or taken late; rates from row to row by them are off by as much",
        "record finer stamps; where no row is missing t may be left out for rate_hz: beside the file",
        recording=recording,
    )
