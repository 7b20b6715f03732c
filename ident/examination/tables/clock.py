"""Whether a column of time is one: its unit, and what to do with stamps that are rounded or come in bursts.

All signals of a row share its stamp, so a constant delay of all stamps harms nothing. Rounded or buffered
stamps lie in a saw-tooth above a straight line over the row number; where they leave it by no more than one
of their own steps, that line is the clock. Where they do not, rows were lost or the clock wandered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ident.examination.check import Check, Outcome, column_line
from ident.examination.tables.ticks import Ticks

SLOWEST = 0.2  # s between samples: nobody records dynamics slower
FASTEST, NEVER = 1e-5, 1e-6  # s: hardly anybody, and nobody, records faster
UNITS = (("ms", 1e-3, 100.0), ("us", 1e-6, 1e5), ("ns", 1e-9, 1e9))  # name, scale, largest step in it
LONGER = (("minutes", 60.0), ("hours", 3600.0), ("days", 86400.0))
KEPT = 0.05  # of its rate, to which a logger keeps it from one recording to the next
LONG = 1.5  # usual steps, and more: rows may be missing
PAUSE = 5.0  # usual steps
ROUNDED = 10  # steps of another length, from which on stamps on a grid are asked for a clock behind them
SIDE = 8  # rows on either side of a gap that show whether the motion goes on
ELSEWHERE = 0.02  # rad or m, that a joint would have gone in the gap
BURSTS = 0.05  # share of rows that share a stamp, or follow closer than a third of the mean


def time_unit(recording: str, step: float, maps: Mapping[str, Any], beside: bool = False) -> Check | None:
    """From the median step of the stamps as they stand; `maps`: the study's columns; beside: others."""
    found = None
    if step >= SLOWEST:
        found = next(((name, scale) for name, scale, most in UNITS if step <= most), UNITS[-1][:2])
    elif step < FASTEST:
        found = next(((name, s) for name, s in LONGER if 2e-4 <= step * s <= 0.1), None)
    if found is None and step < NEVER:
        found = "something else", 1.0
    if found is None:
        return None
    name, scale = found
    return Check(
        "time_unit",
        ("t",),
        f"the samples are {step:g} apart in t, {1 / step:.3g} a second if that were s; "
        f"t looks recorded in {name}",
        "write " + column_line(maps, {"t": {"scale": scale}}, beside)
        if scale != 1
        else "give its scale to seconds, columns: {t: {column: t, scale: ...}}, or leave t out for rate_hz:",
        outcome="refused",
        recording=recording,
    )


@dataclass(frozen=True, slots=True)
class Pace:
    """Of a recording: samples a second, and by how much its joints move a second (n,), as its t says."""

    recording: str
    rate_hz: float
    speed: np.ndarray

    def in_unit(self, other: Pace) -> tuple[str, float] | None:
        """The unit, and its scale, in which it is recorded as often as another one is in s, and moves rather
        as fast."""
        moving = (self.speed > 0) & (other.speed > 0)
        for name, scale, _ in UNITS:
            as_often = abs(np.log(self.rate_hz / scale / other.rate_hz)) < KEPT
            ratio = np.log(self.speed[moving] / other.speed[moving])
            if as_often and np.abs(ratio - np.log(scale)).sum() < np.abs(ratio).sum():
                return name, scale
        return None


def time_unit_beside(its: Pace, others: Iterable[Pace]) -> Check | None:
    """A recording in another unit of time than the others of a study: of a TX40's judged run of 5 kHz in ms
    the samples were 0.2 s apart, which is slow and no more; another robot or another load was told."""
    for other in others:
        found = its.in_unit(other)
        if found:
            return Check(
                "time_unit",
                ("t",),
                f"there are {its.rate_hz:.3g} samples a second if t is in s, in {other.recording} "
                f"{other.rate_hz:.3g}, and its joints are that much slower; t looks recorded in {found[0]}",
                f"give this recording a columns: of its own with {{t: {{scale: {found[1]:g}}}}}",
                outcome="refused",
                recording=its.recording,
            )
    return None


@dataclass(frozen=True, slots=True)
class Clock:
    """A uniform clock found behind stamps: t = start + row / rate_hz, and how far the stamps leave it."""

    start: float
    rate_hz: float
    worst_s: float
    step_s: float
    usual_s: float  # from one of its stamps to the next
    rates: tuple[float, float] | None = None  # that such stamps have, of few steps

    @property
    def known(self) -> bool:
        """Whether its rate is, as well as a logger keeps it."""
        return self.rates is None or self.rates[1] * (1 - KEPT) < self.rates[0] * (1 + KEPT)

    @property
    def told(self) -> str:
        low, high = self.rates or (0.0, 0.0)
        return f"{self.rate_hz:.6g} Hz{f' ({low:.3g} to {high:.3g})' if self.rates else ''}"

    @property
    def believable(self) -> bool:
        return self.worst_s <= 1.05 * self.step_s

    @property
    def unbroken(self) -> bool:
        """Whether no row is missing: stamps of even samples may then wander from the line. (Of a Barrett at
        250 Hz whose log pauses for a minute the line was one of 15 Hz, by which it was read.)"""
        return self.step_s < LONG * self.usual_s


@dataclass(slots=True)
class Grid:
    """Whether stamps, fed in block by block, all lie on a grid of one `step`, and how many of their intervals
    are `other` than it: lost rows, or a clock whose period is no multiple of what its stamps resolve. `ends`:
    row and place on the grid at the end of every block."""

    step: float = 0.0
    other: int = 0
    holds: bool = True
    ends: list[tuple[float, float]] = field(default_factory=list)

    def take(self, intervals: np.ndarray) -> None:
        positive = intervals[intervals > 0]
        if not self.holds or not len(positive):
            return
        self.step = self.step or float(positive.min())
        parts = intervals / self.step
        whole = np.rint(parts)
        self.holds = bool(np.abs(parts - whole).max() < 1e-3)
        self.other += int((whole != 1).sum())
        row, place = self.ends[-1] if self.ends else (0.0, 0.0)
        self.ends.append((row + len(whole), place + float(whole.sum())))

    @property
    def rounded(self) -> bool:
        """Whether it is worth reading all stamps again: rows that were lost here and there leave a line."""
        if not self.holds or self.other < ROUNDED:
            return False
        row, place = np.array(self.ends).T
        return len(row) < 3 or bool(np.ptp(place - np.polyval(np.polyfit(row, place, 1), row)) < 2.0)


def uniform_clock(
    stamps: Callable[[], Iterable[np.ndarray]], window: tuple[float, float] = (-np.inf, np.inf)
) -> Clock:
    """The line over the table's row numbers closest to the stamps [s] inside the window, and their largest
    distance from it and from each other; of few of their steps one that they can be the stamps of, if one is.
    stamps: their blocks, read often, however many there are."""
    sums, first = np.zeros(5), None
    for rows, t in _inside(stamps(), window):
        first = first or (rows[0], t[0])
        r, x = rows - first[0], t - first[1]
        sums += [len(r), r.sum(), x.sum(), r @ r, r @ x]
    assert first is not None
    n, r, x, rr, rx = sums
    step = (rx - r * x / n) / (rr - r * r / n)
    clock = _clock(_inside(stamps(), window), step)
    if n * step * KEPT > clock.step_s:
        return clock
    rates = _rates(_inside(stamps(), window), clock.step_s)
    if rates is not None:
        clock = _clock(_inside(stamps(), window), (1 / rates[0] + 1 / rates[1]) / 2)
    return replace(clock, rates=rates)


def _clock(its: Iterable[tuple[np.ndarray, np.ndarray]], step: float) -> Clock:
    """The one of this period [s] that is nearest to the stamps where it is farthest from them."""
    low, high, longest, usual, first, last = np.inf, -np.inf, 0.0, list[float](), 0.0, np.nan
    for rows, t in its:
        if np.isnan(last):
            first = last = t[0]
        off, steps = (t - first) - rows * step, np.diff(t, prepend=last)
        low, high, longest = min(low, off.min()), max(high, off.max()), max(longest, steps.max())
        usual += [float(np.median(steps[steps > 0]))] if (steps > 0).any() else []
        last = t[-1]
    middle = (high + low) / 2
    each = float(np.median(usual))
    longest = min(float(longest), PAUSE * each)  # a pause is no step of the stamps
    return Clock(float(first + middle), float(1.0 / step), float(high - middle), longest, each)


def _rates(its: Iterable[tuple[np.ndarray, np.ndarray]], step_s: float) -> tuple[float, float] | None:
    """The lowest and the highest rate of even samples whose stamps are these, in steps of `step_s`; None
    where none has. (Of a TX40 in whole seconds 1.1 s at 50 Hz were 39.6 Hz, and its judged runs' error three
    times as large.)"""
    rows, t = (np.concatenate(x) for x in zip(*its))
    begin = np.flatnonzero(np.diff(t, prepend=-np.inf))
    end = np.append(begin[1:], len(t)) - 1
    after = t[begin][None, :] - t[begin][:, None]  # from each stamp to each later one
    gone = rows[begin][None, :] - rows[end][:, None]
    later = np.triu(np.ones(after.shape, bool), 1)
    least = np.max((after[later] - step_s) / gone[later], initial=0.0)
    gone = rows[end][None, :] - rows[begin][:, None]
    later = np.triu(np.ones(after.shape, bool)) & (gone > 0)
    most = np.min((after[later] + step_s) / gone[later], initial=np.inf)
    return (float(1 / most), float(1 / least) if least else np.inf) if least <= most else None


def _inside(
    blocks: Iterable[np.ndarray], window: tuple[float, float]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Row numbers and stamps of the blocks inside a window."""
    begin = 0
    for t in blocks:
        rows = np.flatnonzero((t >= window[0]) & (t < window[1]))
        if len(rows):
            yield (begin + rows).astype(float), t[rows]
        begin += len(t)


def rounded_stamps(recording: str, clock: Clock, grid: Grid, rows: int) -> Check | None:
    """Stamps that a uniform clock's own, rounded to their resolution, would be; None where rows were lost."""
    if clock.worst_s > 0.55 * grid.step:
        return None
    if not clock.known:
        return _unknown(recording, clock, rows)
    return _of_stamps(
        recording,
        rows,
        f"the time stamps are those of a uniform clock of {clock.told}, rounded to "
        f"{1e3 * grid.step:.4g} ms; the clock was used instead",
    )


def _unknown(recording: str, clock: Clock, rows: int) -> Check:
    """Stamps of so few steps that they hardly tell the rate of the samples."""
    low, high = clock.rates or (0.0, 0.0)
    least = f"from {low:.3g} to {high:.3g} Hz" if np.isfinite(high) else f"{low:.3g} Hz or more"
    return _of_stamps(
        recording,
        rows,
        f"the time stamps go on in steps of {1e3 * clock.step_s:.4g} ms, too few to tell how often samples "
        f"were taken ({least})",
        "record the stamps of the samples, or leave t out and give rate_hz: beside the file",
        "refused",
    )


def time_stamps(recording: str, clock: Clock, shared: int, rows: int) -> Check:
    """Stamps that come in bursts or are rounded coarsely: rebuilt where a uniform clock is behind them."""
    what = f"{shared} of {rows} rows share a stamp with the row before or follow it in a burst"
    if clock.believable and not clock.known:
        return _unknown(recording, clock, rows)
    if clock.believable:
        return _of_stamps(recording, rows, f"{what}; {_instead(clock)}")
    return _of_stamps(
        recording,
        rows,
        f"{what}, and no uniform clock is behind them (they leave the nearest by "
        f"{1e3 * clock.worst_s:.3g} ms)",
        "record the stamps where the samples are taken, or leave t out and give rate_hz: beside the file",
        "refused",
    )


def late_stamps(recording: str, clock: Clock, steps: str, rows: int) -> Check:
    """Stamps by whose steps, in words, joints do not go: that were taken late, of samples that are even. (Of
    an LWR4+ whose stamps scatter by a third of a sample 8 % were left for 2.)"""
    return _of_stamps(recording, rows, f"{steps}: {_instead(clock)}")


def stamps_on_ticks(recording: str, its: Ticks, steps: str) -> Check:
    """The same where rows are missing: each was taken at the tick next to its stamp."""
    return _of_stamps(
        recording,
        its.rows,
        f"{steps}: the rows are on ticks of a uniform clock of {1 / its.step:.6g} Hz, {its.missing} of which "
        f"have none, within {1e3 * its.worst_s:.3g} ms; the ticks were used instead",
    )


def _instead(clock: Clock) -> str:
    within = f"{1e3 * clock.worst_s:.3g} ms, which was used instead"
    return f"the stamps are those of a uniform clock of {clock.told} within {within}"


def goes_on(sides: tuple[np.ndarray, np.ndarray], stamps: tuple[np.ndarray, np.ndarray], step: float) -> bool:
    """Whether the positions (K, n) on both sides of a gap follow each other as if one usual step [s] had
    passed, while some joint moves fast enough to have gone elsewhere meanwhile. Rows stand where their stamps
    (K,) say. (With all of them one step apart the clocks of an AIRBOT and a UR10e whose logs lacked 40 % of
    their rows leapt sixty times.)"""
    counts = [len(side) for side in sides]
    if min(counts) < SIDE // 2:
        return False
    both, (before, after) = np.vstack(sides), stamps
    lost = float(after[0] - before[-1]) - step
    t = np.concatenate([before, after - lost])
    noise = sum(np.square(_left(*side, 2)).sum(axis=0) for side in zip(stamps, sides))
    noise = np.sqrt(noise / (sum(counts) - 6))
    left = np.sqrt(np.square(_left(t, both, 3)).sum(axis=0) / (sum(counts) - 4))
    speed = np.abs(both[-1] - both[0]) / np.ptp(t)
    moves = speed * step > np.maximum(noise, 1e-12)
    return bool((left <= 3 * noise + 1e-12).all() and (moves & (speed * lost > ELSEWHERE)).any())


def _left(t: np.ndarray, x: np.ndarray, degree: int) -> np.ndarray:
    """What a polynomial of t (N,) leaves of x (N, n)."""
    columns = np.vander((t - t[0]) / max(float(np.ptp(t)), 1e-300), degree + 1)
    return np.asarray(x - columns @ np.linalg.lstsq(columns, x, rcond=None)[0])


def clock_leap(recording: str, seconds: float, row: int) -> Check:
    """A clock that was set while the recording went on."""
    return Check(
        "time_stamps",
        ("t",),
        f"the clock leaps by {seconds:.4g} s in row {row} while the motion goes on as if no time had passed; "
        "split there",
        outcome="mended",
        recording=recording,
        rows=(row, row),
    )


def _of_stamps(
    recording: str, rows: int, message: str, remedy: str = "", outcome: Outcome = "mended"
) -> Check:
    return Check("time_stamps", ("t",), message, remedy, outcome, recording, (1, rows))
