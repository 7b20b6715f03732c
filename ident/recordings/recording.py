"""One run as a value: where its samples stand, which stretches it has, and its blocks of uniform samples.

`RecordingStream.segments()` yields the uninterrupted stretches of a surveyed recording as blocks of uniform
samples, however long the log is; `RecordingStream.load()` holds them whole as `Recording` values. Opening and
surveying are `opening.py`'s.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ident.errors import RecordingError
from ident.recordings.need import Need
from ident.recordings.resampling import resample
from ident.recordings.study import Role
from ident.recordings.tables import Table

MIN_SAMPLES = 50
Block = tuple[np.ndarray, np.ndarray]  # t (N,), values (N, m): q, then motor, then sensor signals


@dataclass(frozen=True, slots=True)
class Segment:
    """One uninterrupted stretch: [start, end] of its samples, [move_start, move_end] of its motion, all s."""

    start: float
    end: float
    move_start: float
    move_end: float


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


@dataclass(frozen=True, slots=True)
class Recording:
    """One segment held whole: t (N,) [s] uniform, q (N, n) [rad|m], torques (N, n) [N m|N] or None.

    tau_m is in drive units where the drive gains are identified. label is unique in a study; index counts the
    segments of one file.
    """

    label: str
    role: Role
    payload: str | None
    t: np.ndarray
    q: np.ndarray
    tau_m: np.ndarray | None
    tau_l: np.ndarray | None
    rate_hz: float
    index: int = 0
    move_start: float = -np.inf
    move_end: float = np.inf
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RecordingStream:
    """A surveyed recording; nothing of its samples is held."""

    label: str
    role: Role
    payload: str | None
    file: str
    need: Need
    table: Table
    names: tuple[str, ...]  # columns of the table: t (unless counted), q, motor, sensor
    factors: np.ndarray  # (columns,)
    offsets: np.ndarray
    counted_rate_hz: float | None  # t is the row number over this where the table has no time
    window: tuple[float, float]
    stiffness: np.ndarray | None  # (n,) when positions are the joints'
    survey: Survey
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def rate_hz(self) -> float:
        return self.survey.rate_hz

    def segments(self) -> Iterator[tuple[Segment, Iterator[np.ndarray]]]:
        """Segments in order; each with blocks (N, m) of uniform samples, to be used up before the next
        one."""
        pieces = _Pieces(_clean(self, self.survey.gap_s, drop_repeats=not self.survey.uniform))
        for segment in self.survey.segments:
            blocks = pieces.take(segment.start, segment.end)
            yield (
                segment,
                (values for _, values in blocks) if self.survey.uniform else resample(blocks, self.rate_hz),
            )

    def split(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
        """Columns of a block (N, m) -> q (N, n), motor and sensor signals of the joints that need names, or
        None."""
        n, m = len(self.need.joints), len(self.need.motor)
        motor = values[:, n : n + m] if self.need.motor else None
        sensor = values[:, n + m :] if self.need.sensor else None
        return values[:, :n], motor, sensor

    def load(self) -> list[Recording]:
        """The whole recording in memory, one value per segment."""
        out = []
        for index, (segment, blocks) in enumerate(self.segments()):
            values = np.concatenate(list(blocks))
            q, motor, sensor = self.split(values)
            out.append(
                Recording(
                    self.label,
                    self.role,
                    self.payload,
                    segment.start + np.arange(len(q)) / self.rate_hz,
                    q,
                    motor,
                    sensor,
                    self.rate_hz,
                    index,
                    segment.move_start,
                    segment.move_end,
                    self.notes,
                )
            )
        return out


def raw_blocks(stream: RecordingStream) -> Iterator[Block]:
    """SI blocks (t, values) inside the window, checked for finite values."""
    row = 0
    for block in stream.table.blocks(stream.names):
        values = block * stream.factors + stream.offsets
        if stream.counted_rate_hz is not None:
            t = np.arange(row, row + len(values)) / stream.counted_rate_hz
        else:
            t, values = values[:, 0], values[:, 1:]
        inside = (t >= stream.window[0]) & (t < stream.window[1]) | ~np.isfinite(t)
        if not np.isfinite(block).all() and not np.isfinite(block[inside]).all():
            bad_row, bad_column = np.argwhere(~np.isfinite(block) & inside[:, None])[0]
            raise RecordingError(
                stream.file,
                f"column {stream.names[bad_column]} is not a finite number in row "
                f"{row + bad_row + 1}; repair it, or leave it out with from: and to:",
            )
        row += len(block)
        if stream.stiffness is not None:  # Appendix 2: q - tau_l / k
            n = len(stream.need.joints)
            values = values.copy()
            values[:, :n] -= values[:, -n:] / stream.stiffness
        if inside.all():
            yield t, values
        elif inside.any():
            yield t[inside], values[inside]


def _clean(stream: RecordingStream, gap_s: float, drop_repeats: bool) -> Iterator[Block]:
    """Blocks without rows whose stamp repeats and, where asked, without rows that repeat the one before
    them."""
    last_t, last_row = None, None
    for t, values in raw_blocks(stream):
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
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.view(np.int8), [0]])))
    out = np.zeros(len(same), bool)
    for start, end in edges.reshape(-1, 2):
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
