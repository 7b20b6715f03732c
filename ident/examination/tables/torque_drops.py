"""Torques that fall to zero for a moment and come back, again and again, where one joint turns.

The rows in which a joint turns are no equations (what its friction does there is not known), so that nothing
of it is left in a fit; and a moment of some rows is gone in what is filtered. Friction that turns over is a
step, and no moment that a torque comes back from. (Of a rokae whose second gear has play, a sensor and a
drive fell from 60 N m to 0 for 0.01 s behind each turn: 4 % were left of the torque for 0.8, and all of it
was called noise.) A magnitude comes down to zero as well where its torque changes its sign.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ident.examination.check import Check, listed
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.mending import STEP
from ident.examination.tables.signals import BESIDE_ROWS, CHANCE, Columns
from ident.signals.runs import runs_of

LONGEST = 0.05  # s: what lasts longer is in the rows that are fitted
SHARE = 0.1  # of a torque's range that it falls by at least; of a joint's usual rate, below which it turns
LEFT = 0.25  # of the torque, at most, for a fall to zero
SMOOTH = 5  # rows
FASTER = 2.0  # times as fast as it goes anywhere about there
AFTER = (0.05, 0.1, 0.2, 0.4)  # s behind a turn


def torque_drops(columns: Columns, excerpt: Excerpt) -> Iterator[Check]:
    """One check of all torques that fall where the same joint turns, with the joints that turn with it: whose
    gear it is these do not tell."""
    n = columns.n
    drops: list[tuple[int, float, float]] = []  # torque, when, how long
    away = np.zeros(len(columns.signals) - n, int)  # moments at which a torque goes anywhere and comes back
    pieces = [(t, x) for _, t, x in excerpt.pieces if len(t) >= 4 * BESIDE_ROWS and (np.diff(t) > 0).all()]
    for t, values in pieces:
        dt = float(np.median(np.diff(t)))
        around = int(np.clip(round(LONGEST / dt), 4, 2 * BESIDE_ROWS))
        for c, a, b, to_zero in _moments(values[:, n:].T, around):
            away[c] += 1
            if to_zero:
                drops.append((c, t[a], t[b - 1] - t[a] + dt))
    # one that goes elsewhere at least as often has spikes, of which some end near zero by chance
    falls = np.bincount([c for c, *_ in drops], minlength=len(away))
    drops = [drop for drop in drops if 2 * falls[drop[0]] > away[drop[0]]]
    moments = _apart(sorted(at for _, at, _ in drops), LONGEST)
    if not moments:
        return
    stretches = [(float(t[0]), float(t[-1])) for t, _ in pieces]
    turns = [np.concatenate([t[_turns(x[:, j])] for t, x in pieces]) for j in range(n)]
    tied = [_tied(its, np.array(moments), stretches) for its in turns]
    told = [j for j in range(n) if tied[j][0] * n * len(AFTER) < CHANCE and 2 * tied[j][1] > len(moments)]
    joint = min(range(n), key=lambda j: tied[j][0])
    if joint not in told:
        return
    _, count, after, share = tied[joint]
    there = _behind(turns[joint], np.array([at for _, at, _ in drops]), after)
    mine = [drop for drop, its in zip(drops, there) if its]
    names = tuple(columns.signals[n + c] for c in sorted({c for c, _, _ in mine}))
    longest, label = max(long for *_, long in mine), columns.labels[joint]
    others = [columns.labels[j] for j in told if j != joint]
    turning = f"{label} turns" + (f", and joint {listed(others)} with it" if others else "")
    looked = "" if excerpt.every == 1 else f" in the rows that were looked at, one in {excerpt.every}"
    gears = " or ".join((label, *others))
    torques = [excerpt.column(columns.signals.index(name)) for name in names]
    one_sided = any(x.min() >= 0 or x.max() <= 0 for x in torques)  # then it may be a magnitude that turns
    or_turned = ", or it is recorded without its sign, which would change there" if one_sided else ""
    with_sign = "record torques with their signs, " if one_sided else ""
    yield Check(
        "torque_drop",
        names,
        f"{listed(names)} {'falls' if len(names) == 1 else 'fall'} to about zero {len(moments)} times"
        f"{looked}, for up to {longest:.2g} s, {count} of them within {after:g} s after joint {turning}, "
        f"which is {100 * share:.2g} % of the time: nothing is passed on meanwhile, as while a gear with "
        f"play goes from one flank to the other, or a joint that holds no weight sticks{or_turned}",
        f"{with_sign}look for play in the gear of joint {gears}, and whether it rests there; record it "
        "faster than this log to measure it",
    )


def _moments(x: np.ndarray, around: int) -> Iterator[tuple[int, int, int, bool]]:
    """Of torques (C, N) of which some row may be a fall to zero: which one goes elsewhere for a moment, its
    first row, the one behind its last, and whether it is a fall, which is sudden. (Of an arm in MuJoCo that
    goes from point to point torques went to zero and back as it braked and went on the other way, by a fifth
    of them from row to row: a gear had play. Of another arm a sensor fell to zero while its joint,
    which holds no weight, stuck at its turns: that looks the same, and is named beside the gear.)"""
    low, high = np.quantile(x, [0.05, 0.95], axis=1)
    sides = np.minimum(np.abs(x[:, : -2 * around]), np.abs(x[:, 2 * around :]))
    may = (np.abs(x[:, around:-around]) < LEFT * sides) & (sides > SHARE * (high - low)[:, None])
    if not may.any():
        return
    for c in np.flatnonzero(may.any(axis=1)).tolist():
        rows = sliding_window_view(np.pad(x[c], around, mode="edge"), 2 * around + 1)
        course = np.median(rows, axis=1)  # a fit needs no SciPy, whose filter takes longer to import
        off = np.abs(x[c] - course)
        least = max(STEP * np.quantile(off, 0.9), SHARE * (high[c] - low[c]))
        for first, last in runs_of(off > least).tolist():
            if last - first <= around and first > 0 and last < x.shape[1]:
                k = first + int(np.argmax(off[first:last]))
                steps = np.abs(np.diff(x[c, max(first - around, 0) : last + around]))
                edges = slice(min(first, around) - 1, min(first, around) + last - first)
                sudden = steps[edges].max() > FASTER * np.delete(steps, edges).max(initial=0.0)
                yield c, first, last, bool(sudden and abs(x[c, k]) < LEFT * abs(course[k]))


def _apart(moments: Sequence[float], least: float) -> list[float]:
    """The first of those that are closer to each other."""
    return [at for at, before in zip(moments, [-np.inf, *moments]) if at - before > least]


def _turns(q: np.ndarray) -> np.ndarray:
    """Rows in which a position (N,) turns: the farthest one between two ways."""
    q = np.convolve(np.pad(q, SMOOTH // 2, mode="edge"), np.full(SMOOTH, 1 / SMOOTH), mode="valid")
    rate = np.gradient(q)
    ways = np.flatnonzero(np.abs(rate) > SHARE * np.quantile(np.abs(rate), 0.9))
    if not len(ways):
        return ways
    sign = np.sign(rate[ways])
    changes = np.flatnonzero(sign[1:] != sign[:-1])
    return np.array(
        [ways[k] + int(np.argmax(sign[k] * q[ways[k] : ways[k + 1] + 1])) for k in changes.tolist()], int
    )


def _tied(
    turns: np.ndarray, moments: np.ndarray, stretches: Sequence[tuple[float, float]]
) -> tuple[float, int, float, float]:
    """By what chance so many moments are so close behind a joint's turns, how many of them are, within which
    time, and the share of the time that is as close."""
    from scipy.stats import binom  # not at the top: a fit needs no SciPy

    whole = sum(end - begin for begin, end in stretches)
    best = (1.0, 0, 0.0, 0.0)
    for after in AFTER:
        share = min(_covered(turns, after, stretches) / whole, 1.0)
        count = int(_behind(turns, moments, after).sum())
        best = min(best, (float(binom.sf(count - 1, len(moments), share)), count, after, share))
    return best


def _behind(turns: np.ndarray, moments: np.ndarray, after: float) -> np.ndarray:
    """Which moments are at most so long behind a turn."""
    since = moments[:, None] - turns[None, :]
    return np.asarray(((since >= 0) & (since <= after)).any(axis=1))


def _covered(turns: np.ndarray, after: float, stretches: Sequence[tuple[float, float]]) -> float:
    """Seconds that are at most so long behind a turn."""
    covered = 0.0
    for begin, end in stretches:
        at = np.append(np.sort(turns[(turns >= begin) & (turns <= end)]), end)
        covered += float(np.minimum(np.diff(at), after).sum())
    return covered
