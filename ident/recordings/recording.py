"""One run as a value: where its samples stand, which stretches it has, and its blocks of uniform samples.

`RecordingStream.segments()` yields the uninterrupted stretches of a surveyed recording as blocks of uniform
samples, however long the log is. Opening and surveying are `opening.py`'s.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ident.examination.check import Check
from ident.examination.tables.lost_rows import LostRows
from ident.examination.tables.mending import NOTHING, Mending
from ident.examination.tables.shared_stamps import Spread
from ident.examination.tables.signals import MOVED
from ident.examination.tables.ticks import Ticks
from ident.recordings.held import Held
from ident.recordings.need import Need
from ident.recordings.resampling import resample
from ident.recordings.study import Role
from ident.recordings.tables import Table
from ident.signals.runs import runs_of

MIN_SAMPLES = 50
Block = tuple[np.ndarray, np.ndarray]  # t (N,), values (N, m): q, then motor, then sensor signals


@dataclass(frozen=True, slots=True)
class Segment:
    """One uninterrupted stretch: [start, end] of its samples, [move_start, move_end] of its motion, all s;
    the joints that stand at one place throughout."""

    start: float
    end: float
    move_start: float
    move_end: float
    resting: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Survey:
    """What one pass over a recording showed."""

    rows: int
    rate_hz: float  # of the uniform samples handed on
    uniform: bool  # the table's own samples are handed on
    jitter_rms_s: float
    same_stamp_rows: int
    repeated_rows: int
    held_position_rows: int
    lowest: np.ndarray  # (m,)
    highest: np.ndarray
    segments: tuple[Segment, ...]
    gap_s: float  # intervals longer than this split
    missing_rows: int  # shorter holes that interpolation crosses
    mending: Mending = NOTHING  # what replaces samples that are no measurement


@dataclass(frozen=True, slots=True)
class RecordingStream:
    """A surveyed recording; of its samples only what `held` takes for small is held."""

    label: str
    role: Role
    payload: str | None
    file: str
    need: Need
    table: Table
    names: tuple[str, ...]  # columns of the table: t (unless counted), q, motor, sensor
    factors: np.ndarray  # (columns,)
    offsets: np.ndarray
    counted_rate_hz: float | None  # t is the row number over this where the table has no time of its own
    window: tuple[float, float]
    stiffness: np.ndarray | None  # (n,) when positions are the joints'
    survey: Survey
    notes: tuple[str, ...] = ()
    checks: tuple[Check, ...] = ()
    counted_from_s: float = 0.0
    ticks: Ticks | None = None  # of the clock on which its rows were taken, where its stamps are not those
    spread: Spread | None = None  # when its rows were taken, where they share stamps
    lost: LostRows | None = None  # of which the stamps know nothing
    maps: Mapping[str, Any] = field(default_factory=dict, compare=False)  # signal: its column, as it was read
    held: Held = field(default_factory=Held, init=False, repr=False, compare=False)  # by filters

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was found in it and left as it is, as sentences."""
        return tuple(check.sentence for check in self.checks if check.outcome == "warned")

    @property
    def signal_joints(self) -> np.ndarray:
        """(m,) joint (from 0) of each signal: positions, then motor, then sensor torques."""
        return np.array([*range(len(self.need.joints)), *self.need.motor, *self.need.sensor], int)

    def times(self, rows: np.ndarray, plain: np.ndarray) -> np.ndarray:
        """(N,) [s] when rows of the table were taken; plain: their columns in SI units, as in `names`."""
        if self.counted_rate_hz is not None:
            t = np.asarray(self.counted_from_s + rows / self.counted_rate_hz)
        elif self.spread is not None:
            t = self.spread.of(rows)
        else:
            t = plain[:, 0] if self.ticks is None else self.ticks.of(plain[:, 0])
        return t if self.lost is None else t + self.lost.later(rows)

    @property
    def rate_hz(self) -> float:
        return self.survey.rate_hz

    @property
    def still(self) -> np.ndarray:
        """Numbers of the joints that never move in it."""
        n = len(self.need.joints)
        return np.flatnonzero(self.survey.highest[:n] - self.survey.lowest[:n] < MOVED)

    def segments(self) -> Iterator[tuple[Segment, Iterator[np.ndarray]]]:
        """Segments in order; each with blocks (N, m + n) of uniform samples, to be used up before the next
        one.

        The last n columns are 1 where the joint's sample is a measurement, anything else where it is not
        (`weight`).
        """
        pieces = _Pieces(_clean(self, self.survey.gap_s, drop_repeats=not self.survey.uniform))
        for segment in self.survey.segments:
            blocks = pieces.take(segment.start, segment.end)
            yield (
                segment,
                (values for _, values in blocks) if self.survey.uniform else resample(blocks, self.rate_hz),
            )

    def split(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
        """Columns of a block (N, m + n) -> q (N, n), motor and sensor signals of the joints that need names,
        or None."""
        n, m = len(self.need.joints), len(self.need.motor)
        motor = values[:, n : n + m] if self.need.motor else None
        sensor = values[:, n + m : n + m + len(self.need.sensor)] if self.need.sensor else None
        return values[:, :n], motor, sensor

    def weight(self, values: np.ndarray) -> np.ndarray:
        """(N, n) of a block, bool: where the joint's torque and all positions are measurements."""
        return np.abs(values[:, -len(self.need.joints) :] - 1.0) < 1e-6


def raw_blocks(stream: RecordingStream) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Blocks (rows of the table, t, values (N, m) in SI) inside the window; rows without a time are left
    out."""
    row = 0
    plain = (stream.factors == 1).all() and (stream.offsets == 0).all()
    for block in stream.table.blocks(stream.names):
        with np.errstate(all="ignore"):
            values = block if plain else block * stream.factors + stream.offsets
        rows = np.arange(row, row + len(values))
        row += len(block)
        t = stream.times(rows, values)
        values = values if stream.counted_rate_hz is not None else values[:, 1:]
        inside = (t >= stream.window[0]) & (t < stream.window[1]) & np.isfinite(t)
        if stream.stiffness is not None:  # Appendix 2: q - tau_l / k
            n = len(stream.need.joints)
            values = values.copy()
            values[:, :n] -= values[:, -n:] / stream.stiffness
        if inside.all():
            yield rows, t, values
        elif inside.any():
            yield rows[inside], t[inside], values[inside]


def _clean(stream: RecordingStream, gap_s: float, drop_repeats: bool) -> Iterator[Block]:
    """Mended blocks (t, values and weights (N, m + n)) without rows whose stamp repeats and, where asked,
    without rows that repeat the one before them."""
    last_t, last_row = None, None
    n, joints, still = len(stream.need.joints), stream.signal_joints, stream.still
    middle = 0.5 * (stream.survey.lowest + stream.survey.highest)[still]
    for rows, stamps, raw in raw_blocks(stream):
        t, mended, weight = stream.survey.mending.apply(rows, stamps, raw, n, joints)
        if not len(t):
            continue
        if len(still):  # its noise is no motion: parameters fitted to it come out a million times off
            mended = mended.copy()
            mended[:, still] = middle
        values = np.hstack([mended, weight])
        dt = np.diff(t, prepend=t[0] - 1.0 if last_t is None else last_t)
        keep = dt > 0
        if drop_repeats:
            before = np.vstack([values[:1] + 1.0 if last_row is None else last_row, values[:-1]])
            keep &= ~single_repeats((values == before).all(axis=1))
        last_t, last_row = t[-1], values[-1]
        if keep.any():
            yield t[keep], values[keep]


def single_repeats(same: np.ndarray) -> np.ndarray:
    """Runs of at most two repeated rows: a state read again. Longer runs are rest."""
    out = np.zeros(len(same), bool)
    for start, end in runs_of(same):
        if end - start <= 2:
            out[start:end] = True
    return out


class _Pieces:
    """Deals a stream of blocks out to segments by their end times."""

    def __init__(self, blocks: Iterator[Block]) -> None:
        self.blocks = blocks
        self.rest: Block | None = None

    def take(self, start: float, end: float) -> Iterator[Block]:
        """Blocks with start <= t <= end; rows before start (stretches too short to use) are passed over."""
        while True:
            block = self.rest if self.rest is not None else next(self.blocks, None)
            self.rest = None
            if block is None:
                return
            t, values = block
            skip = int(np.searchsorted(t, start))
            t, values = t[skip:], values[skip:]
            count = int(np.searchsorted(t, end, side="right"))
            if count < len(t):
                self.rest = (t[count:], values[count:])
                if count:
                    yield t[:count], values[:count]
                return
            if count:
                yield t, values
