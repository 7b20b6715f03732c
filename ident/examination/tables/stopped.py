"""Positions that stand still while their logged velocity goes on: an encoder or a message that stopped.

A joint that rests has a velocity of zero, or of noise and a bias. Only a velocity that is motion contradicts
a position that does not change at all: smooth, not the same throughout, far more than a resolution goes by;
or one that a position makes up for at once, where it goes on. (Of an AIRBOT's second one, held for 0.3 s at
50 Hz, nothing was said: it leapt no farther than it goes in a row elsewhere.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ident.examination.check import Check
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.repeats import MOST_STILL, STILL_ROWS, STILL_S, TRAVELLED, resolution
from ident.examination.tables.signals import Columns
from ident.examination.tables.velocity import logged_velocities, with_velocities
from ident.signals.runs import runs_of_equals

if TYPE_CHECKING:
    from ident.recordings.recording import RecordingStream
    from ident.recordings.tables import Table

STEPS = 3.0  # of a position's resolution, that its velocity must go by
SPEED = 0.02  # rad/s or m/s about the mean: no velocity of a joint at rest scatters so much
ALIKE = 0.1  # of the scatter of the velocity elsewhere
SMOOTH = 5.0  # times what changes from row to row
SHORT_ROWS, SHORT_S = 6, 0.1  # of a stand that is made up for
AS_MUCH = 0.25  # of what a velocity went by: by which a leap may differ
INSIDE = 0.5  # of that: what goes by in the stand, not behind its last row
UNUSUAL = 3.0  # times the rows that a position keeps one value on the mean
BREAK = 10.0  # usual intervals: nothing is known of the motion between
Block = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # rows, t (N,), q, dq (N, k)


@dataclass(slots=True)
class Run:
    """Rows in which a position keeps one value: first and last row and time, and of the velocity in them the
    count, sum, sum of squares, that of its changes, and the lowest and highest of its integral."""

    value: float
    rows: tuple[int, int]
    t: tuple[float, float]
    sums: np.ndarray  # (4,)
    lowest: float
    highest: float
    made_up: bool = False  # whether the position leaps by as much as the velocity went by, at its end

    def and_then(self, other: Run) -> Run:
        return Run(
            self.value,
            (self.rows[0], other.rows[1]),
            (self.t[0], other.t[1]),
            self.sums + other.sums,
            min(self.lowest, other.lowest),
            max(self.highest, other.highest),
        )

    @property
    def scatter(self) -> float:
        """Standard deviation of the velocity."""
        return _scatter(self.sums)

    @property
    def noise(self) -> float:
        return float(np.sqrt(self.sums[3] / (2 * max(self.sums[0], 1.0))))

    def contradicted(self, step: float, elsewhere: float) -> bool:
        """Whether the velocity moves; step: the position's resolution, elsewhere: the velocity's scatter."""
        return (
            self.sums[0] >= STILL_ROWS
            and self.t[1] - self.t[0] > STILL_S
            and self.highest - self.lowest > max(TRAVELLED, STEPS * step)
            and self.scatter > max(SPEED, ALIKE * elsewhere, SMOOTH * self.noise)
        )


@dataclass(slots=True)
class _Joint:
    """What goes from block to block of one joint; step: its position's resolution."""

    step: float
    number: int = 0  # of runs
    runs: list[Run] = field(default_factory=list)  # the long ones
    open: Run | None = None
    integral: float = 0.0
    last: tuple[float, float] | None = None  # t, dq
    sums: np.ndarray = field(default_factory=lambda: np.zeros(4))

    def take(self, rows: np.ndarray, t: np.ndarray, q: np.ndarray, dq: np.ndarray) -> None:
        before_t, before = self.last or (t[0], dq[0])
        dt, change = np.diff(t, prepend=before_t), np.diff(dq, prepend=before)
        dt = np.where(dt > BREAK * np.median(dt), 0.0, dt)
        gone = self.integral + np.cumsum((dq - 0.5 * change) * dt)
        each = np.stack([np.ones(len(t)), dq, dq**2, change**2])
        begin, length = runs_of_equals(q)
        stop = begin + length - 1
        sums = np.add.reduceat(each, begin, axis=1).T
        lowest, highest = np.minimum.reduceat(gone, begin), np.maximum.reduceat(gone, begin)
        net, leap, inside = np.diff(gone[begin]), np.diff(q[begin]), (gone[stop] - gone[begin])[:-1]
        makes_up = np.abs(inside) > np.fmax(STEPS * self.step, INSIDE * np.abs(net))
        makes_up &= np.abs(leap - net) < AS_MUCH * np.abs(net)
        makes_up &= (length[:-1] >= SHORT_ROWS) & (t[stop[:-1]] - t[begin[:-1]] > SHORT_S)
        makes_up = np.append(makes_up, False)
        self.number += len(begin)
        long = np.flatnonzero((length >= STILL_ROWS) | makes_up)
        for k in sorted({0, *long.tolist(), len(begin) - 1}):
            a, b = begin[k], stop[k]
            run = Run(
                float(q[a]),
                (int(rows[a]), int(rows[b])),
                (float(t[a]), float(t[b])),
                sums[k],
                float(lowest[k]),
                float(highest[k]),
                bool(makes_up[k]),
            )
            goes_on = k == 0 and self.open is not None and self.open.value == run.value
            if self.open is not None and not goes_on:
                self.close()
            self.open = self.open.and_then(run) if goes_on and self.open is not None else run
        self.sums = self.sums + each.sum(axis=1)
        self.integral, self.last = float(gone[-1]), (float(t[-1]), float(dq[-1]))

    def close(self) -> None:
        if self.open is not None and (self.open.made_up or self.open.sums[0] >= STILL_ROWS):
            self.runs.append(self.open)
        self.open = None


def stopped_positions(
    columns: Columns, stream: RecordingStream, table: Table, excerpt: Excerpt
) -> Iterator[Check]:
    """A second pass over a table of which an excerpt shows positions that stand still."""
    has = logged_velocities(columns.labels, columns.maps, table)
    still = {j: at for j, at in has.items() if _stands(excerpt, columns.labels.index(j))}
    if not still or stream.stiffness is not None:
        return
    steps = [resolution(excerpt.column(columns.labels.index(j))) for j in still]
    every = _runs(with_velocities(columns, stream, table, still), steps)
    for j, its in zip(still, every):
        usual = its.sums[0] / max(its.number, 1)
        found = [
            run
            for run in its.runs
            if run.contradicted(its.step, _scatter(its.sums - run.sums))
            or (run.made_up and run.sums[0] >= UNUSUAL * usual)
        ]
        if found:
            yield _told(columns, j, found, its.sums[0], _ends(stream))


def _runs(blocks: Iterable[Block], steps: Iterable[float]) -> list[_Joint]:
    joints = [_Joint(step) for step in steps]
    for rows, t, q, dq in blocks:
        if len(t):
            for joint, its, rate in zip(joints, q.T, np.nan_to_num(dq).T):
                joint.take(rows, t, its, rate)
    for joint in joints:
        joint.close()
    return joints


def _told(columns: Columns, joint: str, found: list[Run], rows: float, ends: tuple[float, float]) -> Check:
    share = sum(run.sums[0] for run in found) / max(rows, 1.0)
    first, last = found[0], found[-1]
    begin, end = first.t[0], last.t[1]
    keys = [f"to: {_second(begin)}"] if begin > ends[0] else []
    keys += [f"from: {_second(end)}"] if end < ends[1] else []
    others = " and others" if len(found) > 1 else ""
    return Check(
        "dead_channel",
        (f"q{joint}",),
        f"q{joint} stands still at {first.value:.4g} for {100 * share:.3g} % of the samples while dq{joint} "
        f"goes on (rows {first.rows[0] + 1} to {first.rows[1] + 1}{others}): "
        "an encoder or a message that stopped, a value held",
        f"leave the stretch out with {' or '.join(keys)}, or find out why it stopped"
        if keys
        else f"map the right column with columns: {{q{joint}: ...}}",
        outcome="refused" if share > MOST_STILL else "warned",
        recording=columns.recording,
        rows=(first.rows[0] + 1, last.rows[1] + 1),
    )


def _second(t: float) -> str:
    """As a study has it."""
    return f"{t:.3f}".rstrip("0").rstrip(".")


def _ends(stream: RecordingStream) -> tuple[float, float]:
    """First and last second that are used, but for a second at either end."""
    segments = stream.survey.segments
    return segments[0].start + 1.0, segments[-1].end - 1.0


def _stands(excerpt: Excerpt, k: int) -> bool:
    """Whether a position keeps one value for long in one of the pieces."""
    for _, t, values in excerpt.pieces:
        begin, length = runs_of_equals(values[:, k])
        begin, length = begin[length >= SHORT_ROWS], length[length >= SHORT_ROWS]
        if (t[begin + length - 1] - t[begin] > SHORT_S).any():
            return True
    return False


def _scatter(sums: np.ndarray) -> float:
    """Standard deviation from count, sum and sum of squares."""
    count = max(sums[0], 1.0)
    return float(np.sqrt(max(sums[2] / count - (sums[1] / count) ** 2, 0.0)))
