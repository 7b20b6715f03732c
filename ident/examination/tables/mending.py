"""Samples of a table that are no measurement: found in one pass, replaced, and kept sparsely.

What is found is kept sparsely (row, column, value instead), so that later passes over the table only look it
up; every replaced sample has weight zero from then on.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ident.examination.tables.excerpt import resumed
from ident.examination.tables.spikes import (
    dead_band,
    dropouts,
    emptied,
    is_spike,
    median_of_four,
    no_measurement,
)
from ident.recordings.resampling import cubic_at
from ident.signals.runs import runs_of

CONTEXT = 64  # rows carried over from block to block
STEP = 10.0  # in what else changes from row to row; 4.8 is the most on the measured robots
LEAST_STEP = 5e-3  # rad or m
RESOLUTION = 1.5  # times the least changes of a position: its resolution, no leap
NEAR = 1.0  # rad: what a leap of whole turns is off at most
QUIET = 0.1  # quantile of what a position's steps change by: its noise, or slow motion
SLOWER = 0.6  # times the step before: what is brought to rest evenly halves its last one at least
FEW, FINE = 3, 0.02  # changes from which it is known; share of them that is let go as put in
Block = tuple[np.ndarray, np.ndarray, np.ndarray]  # rows (N,) of the table, t (N,), values (N, m)


@dataclass(frozen=True, slots=True)
class Mending:
    """What replaces samples: rows (K,), columns (K,), values (K,); rows left out (D,); wraps (W,) each."""

    rows: np.ndarray
    columns: np.ndarray
    values: np.ndarray
    dropped: np.ndarray
    wrap_rows: np.ndarray
    wrap_columns: np.ndarray
    wrap_turns: np.ndarray

    def apply(
        self, rows: np.ndarray, t: np.ndarray, values: np.ndarray, n: int, joint: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """-> kept t, mended values, weight (N, n) per joint: 0 where its torque or any position is made up.

        joint (m,): whose signal each column is; the first n are the positions.
        """
        weight = np.ones((len(t), n))
        if len(self.wrap_rows):
            values = values.copy()
            for k in np.unique(self.wrap_columns):
                mine = self.wrap_columns == k
                turns = np.concatenate([[0.0], np.cumsum(self.wrap_turns[mine])])
                values[:, k] += 2 * np.pi * turns[np.searchsorted(self.wrap_rows[mine], rows, side="right")]
        here = slice(*np.searchsorted(self.rows, [rows[0], rows[-1] + 1]))
        if here.stop > here.start:
            values = values.copy()
            at, column = np.searchsorted(rows, self.rows[here]), self.columns[here]
            values[at, column] = self.values[here]
            weight[at[column < n]] = 0.0
            weight[at, joint[column]] = 0.0
        if len(self.dropped):
            keep = ~np.isin(rows, self.dropped)
            return t[keep], values[keep], weight[keep]
        return t, values, weight


_NONE = np.zeros(0, int)
NOTHING = Mending(_NONE, _NONE, np.zeros(0), _NONE, _NONE, _NONE, _NONE)


@dataclass(slots=True)
class Mender:
    """Feeds blocks through and remembers what it replaced; `counts` is by kind and column (m,)."""

    n: int
    raw_scale: np.ndarray  # (m,) factors of the columns, to recognise sentinels
    raw_offset: np.ndarray
    counts: dict[str, np.ndarray] = field(default_factory=dict)
    first: dict[str, dict[int, tuple[int, int]]] = field(default_factory=dict)  # kind: column: rows
    bands: dict[int, float] = field(default_factory=dict)  # column: below which a torque reads zero
    gaps: list[tuple[float, float]] = field(default_factory=list)  # frozen stretches, s
    steps: list[tuple[int, int, float]] = field(
        default_factory=list
    )  # row, column, size of leaps of positions
    whole: int = 0  # rows that hold a value of every signal
    left_out: int = 0  # rows of runs in which a position is unknown for longer than can be interpolated
    truncated: int | None = None  # row, where the last one is not whole
    _found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)
    _dropped: list[np.ndarray] = field(default_factory=list)
    _wraps: list[tuple[int, int, int]] = field(default_factory=list)
    _least: dict[int, tuple[int, np.ndarray]] = field(default_factory=dict)  # column: changes, the least
    _reach: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (m,) 5 to 95 % of the blocks seen
    _turns: np.ndarray = field(default_factory=lambda: np.zeros(0))
    _still: tuple[int, float, np.ndarray] | None = None  # row, t, values at which a frozen stretch began
    _moving: bool = False  # whether a position then went on by more than it does that comes to rest

    def run(self, blocks: Iterable[Block]) -> Iterator[Block]:
        """The same rows, mended, a little later."""
        rows, t, values, begun = np.zeros(0, int), np.zeros(0), np.zeros((0, 0)), 0
        for block in blocks:
            if not len(t):
                rows, t, values = block
                self._turns = np.zeros(values.shape[1])
            else:
                rows, t, values = (np.concatenate(pair) for pair in zip((rows, t, values), block))
            if len(t) >= 4096:
                done = len(t) - CONTEXT
                out, values = self._mend(rows, t, values, begun, done)
                yield out
                start = done - CONTEXT
                rows, t, values, begun = rows[start:], t[start:], values[start:], CONTEXT
        if len(t) > begun + 1 and not np.isfinite(values[-1]).all() and np.isfinite(values[-2]).all():
            self.truncated = int(rows[-1])
            self._dropped.append(rows[-1:])
            rows, t, values = rows[:-1], t[:-1], values[:-1]
        if len(t) > begun:
            (rows, t, values), _ = self._mend(rows, t, values, begun, len(t))
            kept = self._until_it_stood(rows)
            yield rows[kept], t[kept], values[kept]

    @property
    def leaps(self) -> list[tuple[int, int, float]]:
        """Steps of positions that are more than their resolution."""
        return [s for s in self.steps if abs(s[2]) > RESOLUTION * self._finest(s[1])]

    def mending(self) -> Mending:
        parts = (
            [np.concatenate(part) for part in zip(*self._found)] if self._found else [np.zeros(0, int)] * 3
        )
        order = np.argsort(parts[0], kind="stable")
        wraps = np.array(sorted(self._wraps), int).reshape(-1, 3)
        dropped = np.unique(np.concatenate(self._dropped)) if self._dropped else np.zeros(0, int)
        rows, columns, values = (part[order] for part in parts)
        wrap_rows, wrap_columns, wrap_turns = wraps.T
        return Mending(rows, columns, values, dropped, wrap_rows, wrap_columns, wrap_turns)

    def _mend(
        self, rows: np.ndarray, t: np.ndarray, values: np.ndarray, begun: int, done: int
    ) -> tuple[Block, np.ndarray]:
        """Rows begun..done of a block in its context, mended; and the whole block as it came, for its next
        turn, but without what was found in the rows that are done."""
        raw = values = values.copy(order="F")  # column by column, as it is read
        fresh = np.zeros(len(t), bool)
        fresh[begun:done] = True
        empty = ~np.isfinite(values)
        if not len(self._reach):
            self._reach = np.zeros(values.shape[1])
        sentinel, gross = no_measurement(values, self.raw_scale, self.raw_offset, self._reach)
        band = self._bands(values)
        told = np.where(band | empty, np.nan, values) if band.any() or empty.any() else values
        sentinel |= emptied(told, self.n, self.raw_offset)
        for k in range(self.n, values.shape[1]):
            sentinel[:, k] |= dropouts(told[:, k])
        sentinel &= ~empty
        self.whole += int((fresh & ~empty.any(axis=1)).sum())
        self._count("missing_values", rows, empty & fresh[:, None])
        self._count("sentinel", rows, sentinel & fresh[:, None])
        self._count("dead_band", rows, band & fresh[:, None])
        sentinel |= band
        bad = empty | sentinel | gross
        filled = _filled(t, values, bad)  # of its own where nothing is filled, too
        low, high = np.percentile(filled[:: max(1, len(t) // 2000)], [5, 95], axis=0)
        self._reach = np.maximum(self._reach, high - low)
        self._unwrap(rows, filled, begun, done)
        values = np.where(bad, values, filled) if bad.any() else filled
        spikes = gross & ~empty & ~sentinel
        apart = resumed(t)
        for k in range(values.shape[1]):
            spikes[:, k] |= is_spike(filled[:, k], k < self.n, float(self._reach[k]), apart) & ~bad[:, k]
        self._count("spike", rows, spikes & fresh[:, None])
        bad |= spikes
        lost = bool(bad.any())
        filled = _filled(t, values, bad) if lost else values
        here = bad & fresh[:, None]
        drop = _long_gaps(t, bad[:, : self.n]) & fresh
        self.left_out += int(drop.sum())
        drop |= self._frozen(rows, t, filled, begun, done)
        self._leaps(rows, t, filled, fresh & ~np.roll(drop, 1))
        if here.any():
            at, column = np.nonzero(here)
            self._found.append((rows[at], column, filled[at, column]))
        if drop.any():
            self._dropped.append(rows[drop])
        keep = fresh & ~drop if drop.any() else slice(begun, done)
        bad[done:] = False
        return (rows[keep], t[keep], filled[keep]), np.where(bad, np.nan, raw) if lost else raw

    def _bands(self, values: np.ndarray) -> np.ndarray:
        """(N, m) bool: zeros of torques that read zero wherever they are small."""
        band = np.zeros(values.shape, bool)
        for k in range(self.n, values.shape[1]):
            least = dead_band(values[:, k], self.raw_offset[k])
            if least > 0:
                self.bands[k] = min(least, self.bands.get(k, np.inf))
                band[:, k] = values[:, k] == self.raw_offset[k]
        return band

    def _count(self, kind: str, rows: np.ndarray, bad: np.ndarray) -> None:
        if not bad.any():
            return
        self.counts[kind] = self.counts.get(kind, 0) + bad.sum(axis=0)
        seen = self.first.setdefault(kind, {})
        for k in np.flatnonzero(bad.any(axis=0)):
            at = rows[bad[:, k]] + 1
            seen[int(k)] = (seen.get(int(k), (int(at[0]), 0))[0], int(at[-1]))

    def _unwrap(self, rows: np.ndarray, values: np.ndarray, begun: int, done: int) -> None:
        """Jumps of one turn are undone in place; those in begun..done are remembered."""
        following = 0 if done == len(values) else done - CONTEXT
        for k in range(self.n):
            column = values[:, k]
            step, turns = np.diff(column), _turns(column)
            jumps = np.flatnonzero(turns)
            if len(jumps) and np.quantile(np.abs(step + 2 * np.pi * turns), 0.95) > NEAR:  # not in rad at all
                turns[:] = 0.0
            column += 2 * np.pi * (self._turns[k] + np.concatenate([[0.0], np.cumsum(turns)]))
            for at in np.flatnonzero(turns):
                if begun <= at + 1 < done:
                    self._wraps.append((int(rows[at + 1]), int(k), int(turns[at])))
            self._turns[k] += turns[:following].sum()

    def _leaps(self, rows: np.ndarray, t: np.ndarray, x: np.ndarray, fresh: np.ndarray) -> None:
        """Positions that change by far more from one row to the next than around it, and stay there."""
        dt = np.diff(t)
        if len(dt) < 30 or len(self.steps) > 20:
            return
        step = np.median(dt[dt > 0]) if (dt > 0).any() else 0.0
        usual = dt < 2.5 * step
        for k in range(self.n):
            d = np.diff(x[:, k])
            self._changed(k, d)
            per_row = np.where(usual, d, d * step / np.maximum(dt, 1e-300))  # over a gap at its mean rate
            around = np.pad(per_row, 2, mode="edge")
            off = np.abs(d - median_of_four(around[:-4], around[1:-3], around[3:-1], around[4:])) * usual
            if not off.max() > LEAST_STEP:
                continue
            usually = np.quantile(np.delete(off, np.argmax(off)), 0.99)  # of few rows one is a hundredth
            scale = max(usually, 0.5 * np.quantile(np.abs(d), 0.95), LEAST_STEP / STEP)
            for at in np.flatnonzero(off > STEP * scale):
                near = np.concatenate([off[max(0, at - 25) : max(0, at - 1)], off[at + 2 : at + 27]])
                if abs(d[at]) <= RESOLUTION * self._finest(k):
                    continue
                if fresh[at + 1] and off[at] > STEP * near.max(initial=0.0):
                    self.steps.append((int(rows[at + 1]), k, float(d[at])))

    def _changed(self, k: int, d: np.ndarray) -> None:
        """Takes note of the changes d (N,) of a position."""
        count, least = self._least.get(k, (0, np.zeros(0)))
        fresh = np.abs(d[d != 0])
        every = np.concatenate([least, fresh])
        self._least[k] = count + len(fresh), np.sort(every)[:CONTEXT]

    def _finest(self, k: int) -> float:
        """A position's resolution, or far below it where it has none; 0 where it hardly changes."""
        count, least = self._least.get(k, (0, np.zeros(0)))
        return float(least[min(int(FINE * count), len(least) - 1)]) if count >= FEW else 0.0

    def _frozen(self, rows: np.ndarray, t: np.ndarray, x: np.ndarray, begun: int, done: int) -> np.ndarray:
        """Rows in which nothing at all changed, ending in a jump of a position: the logger stood still."""
        out = np.zeros(len(t), bool)
        first = max(begun, 1)
        before = self._still or (int(rows[first - 1]), float(t[first - 1]), x[first - 1])
        changed = np.flatnonzero((x[first:done] != x[first - 1 : done - 1]).any(axis=1)) + first
        if not len(changed):
            self._still = before
            return out
        since_row, since_t = (np.concatenate([[b], v[changed[:-1]]]) for b, v in zip(before, (rows, t)))
        for at in np.flatnonzero(rows[changed] - since_row > 9):
            here, row = changed[at], int(since_row[at])
            value = before[2] if at == 0 else x[changed[at - 1]]
            step = np.abs(np.diff(x[:, : self.n], axis=0))
            typical = np.array([np.median(s[s > 0]) if (s > 0).any() else np.inf for s in step.T])
            if len(changed) > 8 and (np.abs(x[here, : self.n] - value[: self.n]) > 8 * typical).any():
                out |= (rows > row) & (rows < rows[here])
                self._dropped.append(np.arange(row + 1, rows[here]))
                self.gaps.append((float(since_t[at]), float(t[here])))
                count = np.zeros(x.shape[1], int) + int(rows[here] - row - 1)
                self.counts["frozen"] = self.counts.get("frozen", 0) + count
                self.first.setdefault("frozen", {})[len(self.gaps)] = (row + 2, int(rows[here]))
        last = changed[-1]
        self._still = (int(rows[last]), float(t[last]), x[last])
        steps = np.abs(np.diff(x[max(last - 2, 0) : last + 1, : self.n], axis=0))
        bends = np.abs(np.diff(x[:, : self.n], 2, axis=0))
        least = 1e-6 * bends.max(axis=0, initial=0.0)  # below it steps differ by rounding alone
        some = [b[b > its] for b, its in zip(bends.T, least)]
        quiet = np.array([np.quantile(b, QUIET) if len(b) else np.inf for b in some])
        goes = (steps > 8 * quiet).all(axis=0) & (steps[-1] > SLOWER * steps[0])
        self._moving = len(steps) > 1 and bool(goes.any())
        out[:begun] = False
        return out

    def _until_it_stood(self, rows: np.ndarray) -> np.ndarray:
        """(N,) bool: those of the last rows before nothing at all changes any more, if a position was on its
        way: the driver died, and its last message was written on."""
        if self._still is None or not self._moving or not len(rows) or rows[-1] - self._still[0] <= 9:
            return np.ones(len(rows), bool)
        since = self._still[0]
        self._dropped.append(np.arange(since + 1, rows[-1] + 1))
        count = np.zeros(len(self._still[2]), int) + int(rows[-1] - since)
        self.counts["ended"] = count
        self.first["ended"] = {0: (since + 2, int(rows[-1]) + 1)}
        return rows <= since


def _turns(x: np.ndarray) -> np.ndarray:
    """(N - 1,) whole turns to be added from a row of a position (N,) on. A row to which and from which it
    leaps takes its turns from the last one before it, and leaves none behind. (Of an LWR4+ with two spikes of
    about a turn, one up, the next down, its fifth position was told to leap by two turns and stay there.)"""
    leaps = np.abs(np.diff(x)) > 2 * np.pi - NEAR
    odd = np.zeros(len(x), bool)
    odd[1:-1] = leaps[:-1] & leaps[1:]
    kept = np.flatnonzero(~odd)
    total = np.zeros(len(x))
    turns = _whole(np.diff(x[kept]))
    turns[np.abs(turns) > 1] = 0.0  # what goes on beyond one is no wrap
    total[kept[1:]] = np.cumsum(turns)
    before = kept[np.searchsorted(kept, np.flatnonzero(odd)) - 1]
    total[odd] = total[before] + _whole(x[odd] - x[before])
    return np.diff(total)


def _whole(step: np.ndarray) -> np.ndarray:
    """Whole turns that leave at most NEAR of a leap; 0 where none do (and of NaN)."""
    turns = -np.rint(step / (2 * np.pi))
    return np.asarray(np.where(np.abs(step + 2 * np.pi * turns) <= NEAR, turns, 0.0))


def _filled(t: np.ndarray, values: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """Values with the bad ones interpolated by cubics; held beyond the last good one. Over rows where stamps
    repeat. (Of rounded ones two lost values became millions, of those of a year's seconds none.)"""
    out = values.copy(order="K")
    if not bad.any():
        return out
    time = np.arange(len(t), dtype=float) if (np.diff(t) <= 0).any() else t
    for k in np.flatnonzero(bad.any(axis=0)):
        good = ~bad[:, k]
        if not good.any():
            out[:, k] = 0.0
            continue
        at = np.clip(time[~good], time[good][0], time[good][-1])
        out[~good, k] = (
            cubic_at(time[good], values[good, k : k + 1], at)[:, 0] if good.sum() > 1 else values[good, k]
        )
    return out


def _long_gaps(t: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """(N,) bool: rows of runs in which a position is unknown for longer than motion can be interpolated."""
    out = np.zeros(len(t), bool)
    for column in bad.T:
        for start, stop in runs_of(column):
            if stop - start > 8:
                out[start:stop] = True
    return out
