"""Signals that repeat themselves or another one: copies, torques that stand still while their joint moves,
values held over many rows, resolutions too coarse for what is measured.

Every function is pure and looks at the excerpt of a table; what changes by its own resolution alone (small
counts, slow turns) is told from what a logger repeats by the spacing of its changes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain, islice
from typing import Any

import numpy as np

from ident.examination.check import Check, Outcome, listed
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.signals import MOVED, Columns
from ident.signals.low_pass import LowPass
from ident.signals.resolution import best_cutoff, in_steps, resolution
from ident.signals.runs import runs_of, runs_of_equals

SAME = 1e-9  # of a signal's range
STILL_S, STILL_ROWS, STILL_TIMES = 0.3, 30, 10.0  # s, rows, times the longest usual run of equal values
AT_REST = 0.1  # of its pace elsewhere: what a torque does while its joint rests says nothing
TRAVEL = 0.02  # of the joint's range, moved through meanwhile
MOST_STILL, FEW = 0.05, 40  # share of the samples; values of a signal that stands still by its resolution
NEAR_ZERO, AWAY, VISITS = 0.01, 0.1, 8  # of the largest value
HELD_ROWS, HELD_ALIKE = 4, 0.6  # between changes, share of equal distances
SHOWS = 5.0  # times the cut-off: at fewer values a second the way from one to the next is not all filtered
TRAVELLED = 0.05  # rad or m, that a joint must move for its torque to be asked for more than noise
FEWEST_STEPS, FEWEST_SCALES = 16, 4  # of means of one length, and lengths
WHITE = 4.5  # standard deviations between scatter at one length and at the shortest
LEVELS, TORQUE_LEVELS = 250, 6  # steps of its resolution that a signal's range holds
STEPS_SHARE = 0.25  # of a position's acceleration, from which its resolution is said to make it
NOISY = 0.8  # of the mean square of an acceleration: noise is then twice as large as the motion
SHORTEST, FEWEST_HIGH = 256, 20  # rows of a piece whose spectrum is looked at; frequencies that show noise


def copies(columns: Columns, excerpt: Excerpt) -> Iterator[Check]:
    """Two signals of which one is the other but for scale and offset; which of them is in its place is not
    known here. (Of two arms whose second torque held the third one's the third was to be left out.)"""
    thin = slice(None, None, max(1, len(excerpt.column(0)) // 4000))
    x = np.stack([excerpt.column(k)[thin] for k in range(len(columns.signals))], axis=1)
    span = np.ptp(x, axis=0)
    live = np.flatnonzero(span > 0)
    if len(x) < 100 or len(live) < 2:
        return
    z = (x - x.mean(axis=0)) / np.where(span > 0, span, 1.0)
    alike = np.corrcoef(z[:, live].T)
    for k, m in zip(*(live[its] for its in np.nonzero(np.triu(np.abs(alike) > 1 - 1e-6, 1)))):
        slope = (z[:, k] @ z[:, m]) / (z[:, k] @ z[:, k])
        if np.abs(z[:, m] - slope * z[:, k]).max() > SAME or len(np.unique(x[:, m])) < 10:
            continue
        names, same_joint = (columns.signals[k], columns.signals[m]), columns.joint[k] == columns.joint[m]
        soft = m < columns.n or (k >= columns.n and same_joint)  # a mimicking joint, a torque from a current
        outcome: Outcome = "warned" if soft else "refused"
        torques = [name for name, place in zip(names, (k, m)) if place >= columns.n]
        yield Check(
            "copied_signal",
            names,
            f"{names[0]} and {names[1]} are the same{'' if np.isclose(slope, 1) else ' times a number'}: one "
            "column read for two signals, or a log that repeats one in the place of the other, and nothing "
            "here tells which is right",
            f"map the wrong one with columns: {{{names[0]}: ...}} or columns: {{{names[1]}: ...}}"
            + (
                f", or leave it out with {' or '.join(columns.without([name]) for name in torques)}"
                if torques
                else ""
            ),
            outcome=outcome,
        )


def standing(columns: Columns, excerpt: Excerpt, slow: set[int]) -> Iterator[Check]:
    """Torques that keep one value for a while in which their joint moves, many times longer than elsewhere;
    slow: held anyway. (Of a TX40 at 50 Hz a torque that was held for 0.3 s, 15 rows, made of 4 % 30, and
    nothing was said.)"""
    alike: dict[tuple[Any, ...], list[tuple[int, float]]] = {}
    for k in range(columns.n, len(columns.signals)):
        changes = int(np.count_nonzero(np.diff(excerpt.column(k))))
        if k in slow or excerpt.fewer(k, min(FEW, changes // 2)):  # by its resolution
            continue
        j = int(columns.joint[k])
        low, high = (f(excerpt.column(k)) for f in (np.min, np.max))
        reach, lengths, paces, found = np.ptp(excerpt.column(j)), [], [], []
        for rows, t, values in excerpt.stretches(k, j):
            begin, length = runs_of_equals(values[:, 0])
            gone = np.abs(values[begin + length - 1, 1] - values[begin, 1])
            lengths.append(length)
            paces.append(gone / np.maximum(length - 1, 1))
            for at in np.flatnonzero(length >= STILL_TIMES):
                own = slice(begin[at], begin[at] + length[at])
                moved = np.ptp(values[own, 1]) > max(TRAVEL * reach, 1e-3)
                x = values[own, 0][0]
                sides = values[[max(own.start - 1, 0), min(own.stop, len(values) - 1)], 0]
                step = np.quantile(np.abs(np.diff(values[:, 0])), 0.95)
                inside = low < x < high or np.abs(sides - x).max() > 5 * step
                short = length[at] < STILL_ROWS or np.ptp(t[own]) < STILL_S
                known = x == 0 or rows[own][0] == 0  # of a dead band, or as what is recorded late begins
                if moved and inside and not (short and known):
                    found.append((int(length[at]), int(rows[own][0]) + 1, int(rows[own][-1]) + 1, float(x)))
        if not found:
            continue
        every, pace = np.concatenate(lengths), np.concatenate(paces)
        rests = (every > 1) & (pace < AT_REST * pace[np.isin(every, [run[0] for run in found])].min())
        usual = np.repeat(np.where(rests, 1, every), every)[_others(every, found)]
        most = STILL_TIMES * np.quantile(usual, 0.99, method="lower")
        found = [run for run in found if run[0] >= most]
        if not found:
            continue
        share = sum(run[0] for run in found) / max(every.sum(), 1)
        alike.setdefault((share, *(run[1:3] for run in found)), []).append((k, found[0][3] + 0.0))
    rows = np.concatenate([its for its, _, _ in excerpt.pieces])
    for (share, *runs), its in alike.items():
        inside = [(rows >= first - 1) & (rows < last) for first, last in runs]
        torques = (excerpt.column(k) for k in range(columns.n, len(columns.signals)))
        every_one = all(np.ptp(x[there]) == 0 for x in torques for there in inside)
        yield _standing_still(columns, share, runs, its, every_one)


def _standing_still(
    columns: Columns,
    share: float,
    runs: Sequence[tuple[int, int]],
    its: Sequence[tuple[int, float]],
    every_one: bool,
) -> Check:
    """Torques that do in the same rows; its: each and where; every_one: so do those of joints that hardly
    move meanwhile. (Of a Barrett without its torques at the end the first one was to be left out, and what
    was left was as dead; of a Franka whose torques were held now and then five of seven were.)"""
    names, one = tuple(columns.signals[k] for k, _ in its), len(its) == 1
    joints = listed(dict.fromkeys(columns.labels[columns.joint[k]] for k, _ in its))
    moving = f"joint {joints} moves" if "," not in joints else f"joints {joints} move"
    values = listed(f"{x:.4g}" for x in dict.fromkeys(x for _, x in its))
    zero, other = (any((x == 0) is wanted for _, x in its) for wanted in (True, False))
    torques = "" if every_one else f", or the torque{'s' * (not one)} with {columns.without(names)}"
    off = f"a drive that was off{' or at its limit' * other}, a cable, a value held{', a dead band' * zero}"
    if every_one and len(names) < len(columns.signals) - columns.n:
        off = (
            "so does every torque, of joints that hardly move, too: values that a logger held, or no drive on"
        )
    return Check(
        "dead_channel",
        names,
        f"{listed(names)} {'stands' if one else 'stand'} still at {values} for {100 * share:.3g} % of the "
        f"samples while {moving} (rows {runs[0][0]} to {runs[0][1]}{' and others' * (len(runs) > 1)}): {off}",
        f"leave the stretch out with from: and to:{torques}",
        outcome="refused" if share > MOST_STILL else "warned",
        rows=(runs[0][0], runs[-1][1]),
    )


def unsigned(columns: Columns, excerpt: Excerpt) -> Iterator[Check]:
    """Torques that come down to zero again and again and never below it, together; beside them those that
    have one sign as well, which may be what the same logger made of torques that do not come down to zero.
    (Of a Franka's magnitudes three were told, and of the others that two positions are exchanged; of a
    rokae's the first was to be left out with the third kept, and the third with the first.)"""
    told, beside = dict[str, int](), list[str]()
    for k in range(columns.n, len(columns.signals)):
        x = excerpt.column(k)
        if x.min() < 0 < x.max() or excerpt.fewer(k, FEW):
            continue
        size = np.abs(x) / max(np.abs(x).max(), 1e-300)
        state = np.where(size < NEAR_ZERO, 0, np.where(size > AWAY, 1, -1))
        visits = state[state >= 0]
        count = int(((visits[:-1] == 1) & (visits[1:] == 0)).sum())
        if count < VISITS:
            beside.append(columns.signals[k])
        else:
            told[columns.signals[k]] = count
    if not told:
        return
    names, times = listed(told), listed(told.values())
    text = (
        f"{names} comes down to zero {times} times and never changes its sign: a magnitude, or a sensor of "
    )
    text, remedy = f"{text}one direction", "record it with its sign"
    if len(told) > 1:
        text = (
            f"{names} come down to zero {times} times and never change their signs: magnitudes, or sensors "
        )
        text, remedy = f"{text}of one direction", "record them with their signs"
    if len(told) < len(columns.signals) - columns.n:
        where, them = ", where the others are right," if beside else "", "them" if len(told) > 1 else "it"
        remedy += f", or{where} leave {them} out with {columns.without([*told])}"
    yield Check("unsigned_torque", tuple(told), text, remedy)
    if beside:
        verb, what = ("have", "magnitudes") if len(beside) > 1 else ("has", "a magnitude")
        yield Check(
            "unsigned_torque",
            tuple(beside),
            f"{listed(beside)} {verb} one sign throughout, too, as {listed(told)}: {what}, or kept on one "
            "side by a load",
            "record all torques with their signs",
        )


def noise_alone(columns: Columns, excerpt: Excerpt) -> Iterator[Check]:
    """Torques that are white noise about a constant while their joint moves: means over 2, 4, 8 ... samples
    scatter as those of independent samples do, at every length (Haar's variances), and so do the longest
    about the mean of all. Gravity, friction or an offset that turns with the motion would show in the long
    ones, however far below the noise, where the joint goes there and back. (Of four seconds of a UR10e up to
    0.2 s alone were asked, and three torques told as dead; of a second of a KR 300, one way, one.)"""
    for k in range(columns.n, len(columns.signals)):
        q = excerpt.column(int(columns.joint[k]))
        there, back = np.max(q - np.minimum.accumulate(q)), np.max(np.maximum.accumulate(q) - q)
        if min(there, back) < TRAVELLED or excerpt.fewer(k, 3):
            continue
        low, high = np.quantile(excerpt.column(k), [0.1, 0.9])  # spikes would drown what is below them
        means = [np.clip(values[:, k], low, high) for _, _, values in excerpt.pieces]  # over `size` samples
        size, ratios = 1, []
        first = 0.0
        while True:
            pairs = [x[: len(x) // 2 * 2].reshape(-1, 2) for x in means]
            steps = np.concatenate([pair[:, 1] - pair[:, 0] for pair in pairs])
            if len(steps) < FEWEST_STEPS:
                break
            power = float(np.mean(steps**2)) * size
            first = first or power
            if not first:
                break
            ratios.append((power / first - 1.0) / np.sqrt(2.0 / len(steps)))
            if abs(ratios[-1]) >= WHITE:
                break
            size, means = 2 * size, [0.5 * (pair[:, 0] + pair[:, 1]) for pair in pairs]
        if len(ratios) < FEWEST_SCALES or abs(ratios[-1]) >= WHITE:
            continue
        longest = np.concatenate(means)
        ratio = 2 * size * float(np.var(longest, ddof=1)) / first - 1.0
        if ratio < WHITE * np.sqrt(2.0 / (len(longest) - 1)):
            name, x = columns.signals[k], excerpt.column(k)
            yield Check(
                "dead_channel",
                (name,),
                f"{name} is noise about {x.mean():.3g} and nothing else while joint "
                f"{columns.labels[columns.joint[k]]} moves: dead, absent, or far below its own noise",
                f"leave it out with {columns.without([name])}",
            )


def _others(every: np.ndarray, found: list[tuple[int, int, int, float]]) -> np.ndarray:
    """(rows,) bool: of all rows by run, those outside the runs that were found."""
    long = np.isin(every, [run[0] for run in found])
    keep = ~np.repeat(long, every)
    return keep if keep.any() else np.ones(len(keep), bool)


def periods(columns: Columns, excerpt: Excerpt) -> dict[int, tuple[float, int]]:
    """Of every signal that changes only every so many rows: s and rows from one change to the next. Not of
    one that goes on by one step of its resolution at a time, as it does in even motion. (Of a joint that
    turns at a constant rate, in steps of half a degree, it was told that it is recorded at 7 Hz; of a UR10e's
    current of 10 Hz, 9 or 10 rows of an uneven clock, 11.1 Hz.)"""
    found: dict[int, tuple[float, int]] = {}
    for k in range(len(columns.signals)):
        x = excerpt.column(k)
        changes = np.count_nonzero(x[1:] != x[:-1]) - 2 * len(excerpt.pieces)
        if len(x) < 1.5 * changes:  # half of the runs cannot be of two rows
            continue
        gaps, lasted = [], []
        for _, t, values in excerpt.pieces:
            begins, lengths = runs_of_equals(values[:, k])
            gaps.append(lengths[1:-1])
            lasted.append(np.diff(t[begins[1:]]))
        every = np.concatenate(gaps)
        if len(every) < 10:
            continue
        usual = float(np.median(every))
        alike = np.abs(every - usual) <= max(usual >= HELD_ROWS, 0.1 * usual)  # of few rows the same
        if usual > 1 and np.mean(alike) > HELD_ALIKE and not _by_single_steps(x):
            found[k] = (float(np.mean(np.concatenate(lasted)[alike])), int(usual))
    return found


def _by_single_steps(x: np.ndarray) -> bool:
    """Whether a signal (N,) mostly changes by one step of its resolution."""
    changes, step = np.abs(np.diff(x)), resolution(x)
    return stepped(x) and bool(np.median(changes[changes > 0]) < 1.5 * step)


def held(columns: Columns, slow: Mapping[int, tuple[float, int]]) -> Iterator[Check]:
    """Signals that change so seldom that it shows."""
    if not slow:
        return
    names = tuple(columns.signals[k] for k in slow)
    seconds, rows = max(slow.values())
    yield Check(
        "held_signal",
        names,
        f"{listed(names)} change{'s' if len(names) == 1 else ''} only every {rows} rows ({seconds:.3g} s): "
        f"recorded at {1 / seconds:.3g} Hz and held, which is late by {500 * seconds:.3g} ms in the mean",
        "record them at the rate of the others; cut-offs above a fifth of theirs show the steps",
    )


def stale(columns: Columns, excerpt: Excerpt) -> Iterator[Check]:
    """Rows that repeat the one before in every signal, in all torques or in all positions, some at a time, in
    which a joint has gone on by what it does in as many: messages that were lost, the last one written on;
    fewer at a time than are told by themselves. What resolution makes repeat seldom does so for long. (Of a
    UR10e at 50 Hz, of which each 0.8 s the last 0.16 were, it was told that its clock is 6 times too slow, or
    its lengths 40 times too large; of an AIRBOT whose torques alone were nothing was.)"""
    m, n = len(columns.signals), columns.n
    each = {"every signal": slice(0, m), "all torques": slice(n, m), "all positions": slice(0, n)}
    several = {words: its for words, its in each.items() if its.stop - its.start > 1}
    yield from islice(chain.from_iterable(_stale(columns, excerpt, *its) for its in several.items()), 1)


def _stale(columns: Columns, excerpt: Excerpt, words: str, which: slice) -> Iterator[Check]:
    number, rows, short, seconds, span = 0, 0, 0, list[float](), list[int]()
    for its, t, values in excerpt.pieces:
        rows += len(its)
        q = values[:, : columns.n]
        steps = np.abs(np.diff(q, axis=0))
        usual = np.array([np.median(x[x > 0]) if (x > 0).any() else np.inf for x in steps.T])
        for begin, end in runs_of((values[1:, which] == values[:-1, which]).all(axis=1)):
            count = int(end - begin)
            if not HELD_ROWS <= count < STILL_TIMES - 1 or end == len(steps):
                short += count < HELD_ROWS
                continue
            if (np.abs(q[end + 1] - q[begin]) > HELD_ALIKE * count * usual).any():
                number += count
                seconds.append(float(t[end + 1] - t[begin]))
                span += [int(its[begin]) + 2, int(its[end]) + 1]
    enough = number > MOST_STILL * rows and len(seconds) > short
    if enough and seldom(float(np.median(seconds)), columns):
        yield Check(
            "frozen",
            () if words == "every signal" else columns.signals[which],
            f"{100 * number / rows:.2g} % of the rows repeat the one before in {words}, for "
            f"{np.median(seconds):.2g} s at a time, though joints were on their way (rows {min(span)} to "
            f"{max(span)}): messages that were lost, the last one written on",
            "record it again, or without the rows that repeat",
            outcome="refused",
            rows=(min(span), max(span)),
        )


def seldom(seconds: float, columns: Columns) -> bool:
    """Whether values that are new only every so many s show behind the cut-off, to three digits, as stamps
    have it. (Of a TX40's torques of 25 Hz, told from 40 ms on, those of one run of three were.)"""
    return float(f"{seconds * SHOWS * columns.cutoff_hz:.3g}") > 1


def stepped(x: np.ndarray) -> bool:
    """Whether a signal (N,) moves in steps of its resolution."""
    return in_steps(x, resolution(x))


def coarse(columns: Columns, excerpt: Excerpt, slow: Collection[int]) -> Iterator[Check]:
    """Signals whose range holds few steps of their resolution, and positions of whose acceleration the steps
    make much."""
    told: dict[str, float] = {}
    shares: dict[str, tuple[float, float, float]] = {}  # position: step, share, Hz of its filter
    for k, name in enumerate(columns.signals):
        x, position = excerpt.column(k), k < columns.n
        levels = LEVELS if position else TORQUE_LEVELS
        steps = np.abs(np.diff(x))
        small = np.count_nonzero(steps < np.ptp(x) / levels) - np.count_nonzero(steps == 0)
        # the quantile below is one of these, so that enough of them fit
        if not position and small > 0.02 * len(steps) + 2:
            continue
        steps = steps[steps > 0]
        few = not position and excerpt.fewer(k, TORQUE_LEVELS)  # however seldom it changes
        if (len(steps) < 20 and not few) or k in slow or excerpt.fewer(k, 3):  # a switch is told by itself
            continue
        if excerpt.reach(int(columns.joint[k])) < MOVED:  # it rests
            continue
        step = resolution(x)
        if not in_steps(x, step):
            continue
        if np.ptp(x) / step < levels:
            told[name] = step
        elif position and _share_of_steps(excerpt, k, step, columns.cutoff_hz) > STEPS_SHARE:
            hz = _filter_of(excerpt, k, columns.cutoff_hz)
            share = _share_of_steps(excerpt, k, step, hz)
            shares |= {name: (step, share, hz)} if share > STEPS_SHARE else {}
    positions = {name: step for name, step in told.items() if name in columns.signals[: columns.n]}
    finer, lower = (
        "record with a finer resolution or a larger motion",
        ", or a lower filter: {position_cutoff_hz: ...}",
    )
    for its, what, also in (
        (positions, "rates and accelerations are", lower),
        ({name: told[name] for name in told if name not in positions}, "what is fitted to them is", ""),
    ):
        if its:
            yield Check(
                "coarse_signal",
                tuple(its),
                f"{listed(its)} move{'s' if len(its) == 1 else ''} in steps of {_largest(columns, its)}, few "
                f"of which fit into the whole motion: {what} mostly those steps",
                finer + also,
            )
    if shares:
        largest = _largest(columns, {name: step for name, (step, *_) in shares.items()})
        _, share, hz = max(shares.values(), key=lambda its: its[1])
        yield Check(
            "coarse_signal",
            tuple(shares),
            f"{listed(shares)} move{'s' if len(shares) == 1 else ''} in steps of {largest}: behind a filter "
            f"of {hz:.3g} Hz they make {'up to ' if len(shares) > 1 else ''}{100 * share:.0f} % of the "
            "acceleration, which errors and inertias feel",
            finer + (lower if hz == columns.cutoff_hz else ""),
        )


def _filter_of(excerpt: Excerpt, k: int, cutoff_hz: float) -> float:
    """Hz of a position's filter, lowered for its steps where it moves in such (signals/resolution.py), as the
    longest stretch of the excerpt tells it."""
    if not in_steps(excerpt.column(k), step := resolution(excerpt.column(k))):
        return cutoff_hz
    _, t, x = max(excerpt.stretches(k, k), key=lambda its: len(its[0]))
    rate, seconds = 1.0 / float(np.median(np.diff(t))), float(t[-1] - t[0])
    return min(cutoff_hz, best_cutoff(x[:, 0], step, LowPass(cutoff_hz, rate), seconds))


def _largest(columns: Columns, steps: Mapping[str, float]) -> str:
    """The largest step of some signals, with its unit."""
    ranked = sorted(steps, key=lambda its: steps[its])
    said = [columns.sized(columns.signals.index(name), steps[name]) for name in ranked]
    return f"up to {said[-1]}" if len(set(said)) > 1 else said[-1]


def noisy(columns: Columns, excerpt: Excerpt, others: set[int]) -> Iterator[Check]:
    """Positions of whose acceleration noise makes twice as much as the motion does. Not of others, which are
    told to be held or coarse, nor of a joint that hardly moves. (Of a UR10e's first with noise of 0.01 rad a
    contact at the fifth current was told; of eleven measured robots' noise makes at most a quarter of the
    mean square, and half where an AIRBOT's last joint turns by 8 mrad.)"""
    shares = {
        name: share
        for k, name in enumerate(columns.signals[: columns.n])
        if k not in others
        and excerpt.reach(k) > TRAVELLED
        and _share_of_noise(excerpt, k, columns.cutoff_hz) ** 2 > NOISY
        and (share := _share_of_noise(excerpt, k, _filter_of(excerpt, k, columns.cutoff_hz))) ** 2 > NOISY
    }
    if shares:
        yield Check(
            "noisy_position",
            tuple(shares),
            f"{listed(shares)} {'is' if len(shares) == 1 else 'are'} noisy, or no position (a velocity or "
            f"a torque in its place): behind a filter of {columns.cutoff_hz:g} Hz noise makes "
            f"{'up to ' if len(shares) > 1 else ''}"
            f"{100 * max(shares.values()) ** 2:.0f} % of the mean square of the acceleration, which errors "
            "and inertias feel",
            "look at its plot; record it with less noise, or fit with a lower filter: "
            "{position_cutoff_hz: ...}",
            hint=True,
            open=True,
        )


def _share_of_noise(excerpt: Excerpt, k: int, cutoff_hz: float) -> float:
    """Root mean square of the acceleration that noise leaves below the cut-off, over that of the position as
    recorded. Noise is taken as white, as high as the median of what lies between the cut-off, or half of what
    is recorded, and half of the rate: where motion or a filter reach, less than it is."""
    power = noise = 0.0
    for rate, f, density in _spectra(excerpt, k):
        low, high = f < min(cutoff_hz, rate / 2), f > max(cutoff_hz, rate / 4)
        if np.count_nonzero(high) >= FEWEST_HIGH:
            weight = (2 * np.pi * f[low]) ** 4
            power += float(density[low] @ weight)
            noise += float(np.median(density[high]) / np.log(2) * weight.sum())
    return float(np.sqrt(min(noise / power, 1.0))) if power else 0.0


def _spectra(excerpt: Excerpt, k: int) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
    """Of every piece without a pause its rate, frequencies and what a position's deviations from a line have
    there. (Of two recordings in one file, a minute apart, positions were told to be noise, or none.)"""
    for _, t, values in excerpt.unpaused():
        if len(t) < SHORTEST or not t[-1] > t[0]:
            continue
        N, rate = len(t), (len(t) - 1) / (t[-1] - t[0])
        x = values[:, k] - np.linspace(values[0, k], values[-1, k], N)
        window = np.hanning(N)
        yield rate, np.fft.rfftfreq(N, 1 / rate), np.abs(np.fft.rfft(x * window)) ** 2 / np.mean(window**2)


def _share_of_steps(excerpt: Excerpt, k: int, step: float, cutoff_hz: float) -> float:
    """Root mean square of the acceleration that rounding to `step` leaves below the cut-off, over that of the
    position as recorded. Rounding is taken as white, step^2 / 12 spread up to half of the rate, the least
    that it is there: of a slow motion more of it lies below."""
    power, count, rates = 0.0, 0, []
    for rate, f, density in _spectra(excerpt, k):
        low = f < min(cutoff_hz, rate / 2)
        N = 2 * (len(f) - 1)
        power += float(2 * (density[low] @ (2 * np.pi * f[low]) ** 4) / N)
        count += N
        rates.append(rate)
    if not power:
        return 0.0
    rate = float(np.median(rates))
    noise = step**2 / 12 * 2 / rate * (2 * np.pi) ** 4 * min(cutoff_hz, rate / 2) ** 5 / 5
    return float(np.sqrt(min(noise * count / power, 1.0)))
