"""The weighted equations of every recording at one decimation cut-off: what fit and diagnose both start from.

    recording -> filtered blocks -> [entries of W, study's own columns, Y] * certain -> decimated rows -> R

A block of filtered samples is evaluated (the non-zero entries of W only), every row is multiplied by how much
it counts (filtering.py: certain), all of it is decimated by the same weights, and the decimated rows go into
one factor per channel. Memory does not grow with the sampling rate: what is kept are the decimated rows, on
disk where they are many.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ident.equations.columns import Columns
from ident.equations.observation import LEAST, DecimatedSegment, GrowingFactor, RecordingSystem
from ident.equations.prepared import Prepared
from ident.equations.spilled import Spool, joined
from ident.errors import NotEnoughDataError, StudyError
from ident.progress import Progress, silent
from ident.recordings.recording import RecordingStream
from ident.signals.decimation import Decimator, kept_every
from ident.signals.filtering import FilterBank, FilteredBlock, LowPass, filter_stream

HELD = 2_000_000  # decimated entries of a recording that are held in double precision; longer ones in single
SPILL = 12_000_000  # decimated entries of all recordings from which on they wait on disk
HIGHEST = 0.4  # of the sampling rate: cut-off of the decimation
Observer = Callable[[RecordingStream, int, FilteredBlock], None]  # recording, number of the segment, block
Moved = Callable[[RecordingStream, int, FilteredBlock], FilteredBlock]
Tick = Callable[[int], None]


def build(
    prepared: Prepared,
    cutoff_hz: float,
    *,
    roles: Sequence[str] = ("identify", "validate", "test"),
    excerpt_s: float = np.inf,
    observer: Observer | None = None,
    moved: Moved | None = None,
    progress: Progress = silent,
) -> tuple[RecordingSystem, ...]:
    """Every recording with one of these roles (or its first `excerpt_s` seconds of motion), in their order.

    `observer` sees each filtered block on the way (fine.py keeps some of it); `moved` gives another motion
    for its instants (estimators/simulated.py). Raises StudyError for a cut-off that a recording's rate cannot
    carry, NotEnoughDataError for a recording of which nothing is left.
    """
    streams = [(s, bank) for s, bank in zip(prepared.streams, prepared.banks) if s.role in roles]
    check_cutoff(prepared, cutoff_hz)
    total, done = sum(stream.survey.rows for stream, _ in streams), 0

    def tick(samples: int) -> None:
        nonlocal done
        done += samples
        progress("evaluating the regressor", min(done / total, 1.0))

    order = prepared.study.filter.order
    spool = Spool() if entries_of(prepared, [s for s, _ in streams], cutoff_hz, excerpt_s) > SPILL else None
    return tuple(
        observe(stream, bank, prepared.columns, cutoff_hz, order, tick, excerpt_s, observer, spool, moved)
        for stream, bank in streams
    )


def entries_of(
    prepared: Prepared, streams: Sequence[RecordingStream], cutoff_hz: float, excerpt_s: float = np.inf
) -> float:
    """About how many decimated entries these recordings leave."""
    return sum(
        min(stream.survey.rows, excerpt_s * stream.rate_hz)
        / kept_every(cutoff_hz, stream.rate_hz)
        * len(prepared.columns.entries(stream.payload)[0])
        for stream in streams
    )


def check_cutoff(prepared: Prepared, cutoff_hz: float) -> None:
    """Raises StudyError when the slowest recording has too few samples a second for it."""
    slowest = min(stream.rate_hz for stream in prepared.streams)
    if cutoff_hz > HIGHEST * slowest:
        raise StudyError(
            str(prepared.study.file),
            "filter.decimation_cutoff_hz",
            f"{cutoff_hz:g} Hz is too high for samples at {slowest:g} Hz; give at most "
            f"{HIGHEST * slowest:.3g}",
        )


def observe(
    stream: RecordingStream,
    bank: FilterBank,
    columns: Columns,
    cutoff_hz: float,
    order: int = 4,
    tick: Tick | None = None,
    excerpt_s: float = np.inf,
    observer: Observer | None = None,
    spool: Spool | None = None,
    moved: Moved | None = None,
) -> RecordingSystem:
    """Evaluate, decimate and factor one recording. Raises NotEnoughDataError when nothing remains of it."""
    layout = _Layout.of(columns, stream.payload)
    filter, every = LowPass(cutoff_hz, stream.rate_hz, order), kept_every(cutoff_hz, stream.rate_hz)
    few = stream.survey.rows / every * len(layout.channel) < HELD  # R is double in any case
    rows = _Rows(layout, few, spool)
    folding: _Folding | None = None
    current, samples = -1, 0
    for index, block in filter_stream(stream, bank):
        if index != current:
            if folding:
                folding.finish()
            start = float(block.t[0]) - 1.0 / stream.rate_hz
            folding = _Folding(rows, filter, every, start, index)
            current = index
        assert folding is not None
        folding.push(moved(stream, index, block) if moved else block)
        if observer:
            observer(stream, index, block)
        samples += len(block.t)
        if tick:
            tick(len(block.t))
        if samples >= excerpt_s * stream.rate_hz:
            break
    if folding:
        folding.finish()
    if not rows.segments:
        raise NotEnoughDataError(
            f"{stream.file}: nothing is left of {stream.label} after rest and filter transients "
            "are cut; record longer or raise the filter's cut-off"
        )
    return RecordingSystem(
        stream.label,
        stream.role,
        stream.payload,
        layout.channel[layout.free],
        layout.column[layout.free],
        tuple(factor.factor() for factor in rows.factors),
        tuple(rows.segments),
        samples,
    )


@dataclass(frozen=True, slots=True)
class _Layout:
    """Rows of what is decimated in one recording: E model entries, then the study's own columns."""

    columns: Columns
    used: np.ndarray  # entries of model.nonzeros
    channel: np.ndarray  # (E',) of entries and own columns
    column: np.ndarray  # (E',); -1 - k is known parameter k
    joint_of: np.ndarray  # (channels,) position of each channel's joint

    @classmethod
    def of(cls, columns: Columns, payload: str | None) -> _Layout:
        used, channel, column = columns.entries(payload)
        own = [(extra.channel, extra.column) for extra in columns.extras]
        places = np.array(own, int).reshape(-1, 2)
        return cls(
            columns,
            used,
            np.concatenate([channel, places[:, 0]]),
            np.concatenate([column, places[:, 1]]),
            columns.joint_of,
        )

    @property
    def free(self) -> np.ndarray:
        """(E',) bool: entries of parameters that are identified."""
        return self.column >= 0

    def others(self, block: FilteredBlock, certain: np.ndarray) -> np.ndarray:
        """Own columns, Y and the weights of a block, (own + channels + joints, N)."""
        own = [e.values(block) * certain[self.joint_of[e.channel]] for e in self.columns.extras]
        return np.vstack([*own, self.columns.torque(block).T * certain[self.joint_of], certain])


@dataclass(slots=True)
class _Folding:
    """Decimates the blocks of one segment."""

    rows: _Rows
    filter: LowPass
    every: int
    start: float  # s: one sample before the segment's first
    index: int
    kept: int = 0
    parts: list[DecimatedSegment] = field(default_factory=list)
    entries: Decimator = field(init=False)
    others: Decimator = field(init=False)

    def __post_init__(self) -> None:
        layout = self.rows.layout
        columns = layout.columns
        wide = len(columns.extras) + len(layout.joint_of) + len(columns.need.joints)
        self.entries = Decimator(self.filter, self.every, len(layout.used))
        self.others = Decimator(self.filter, self.every, wide)

    def push(self, block: FilteredBlock) -> None:
        layout = self.rows.layout
        model = layout.columns.model
        certain = np.ascontiguousarray(block.certain.T)
        others = layout.others(block, certain)
        everything = len(layout.used) == len(model.nonzeros)
        joint = layout.joint_of[layout.channel[: len(layout.used)]]
        for rows, values in model.nonzero_blocks(block.q, block.dq, block.ddq, sign=block.sign_dq):
            chosen = values if everything else values[layout.used]
            weighted = chosen * certain[:, rows][joint]
            self._take(self.entries.push(weighted), self.others.push(others[:, rows]))

    def _take(self, entries: np.ndarray | None, others: np.ndarray | None) -> None:
        if entries is None or others is None or not entries.shape[1]:
            return
        count = entries.shape[1]
        instants = np.arange(self.kept, self.kept + count) + 1
        t = self.start + instants * self.every / self.filter.rate_hz
        self.parts.append(self.rows.take(t, entries, others))
        self.kept += count

    def finish(self) -> None:
        """The rows still pending; the segment is whole."""
        self._take(self.entries.finish(), self.others.finish())
        if self.parts:
            self.rows.segments.append(
                DecimatedSegment(
                    np.concatenate([part.t for part in self.parts]),
                    joined([part.values for part in self.parts]),
                    np.hstack([part.Y for part in self.parts]),
                    np.hstack([part.weight for part in self.parts]),
                    self.index,
                )
            )
            self.parts = []


class _Rows:
    """Decimated rows of one recording: pushed into its factors, kept by segment."""

    def __init__(self, layout: _Layout, double: bool, spool: Spool | None = None) -> None:
        self.layout, self.double, self.spool = layout, double, spool
        self.known = np.array(list(layout.columns.known.values()))
        self.segments: list[DecimatedSegment] = []
        self.factors = [
            GrowingFactor(np.unique(layout.column[layout.free & (layout.channel == j)]))
            for j in range(len(layout.joint_of))
        ]

    def take(self, t: np.ndarray, entries: np.ndarray, others: np.ndarray) -> DecimatedSegment:
        """entries (E, m) and others (own + channels + joints, m) as decimated -> the rows that count."""
        layout = self.layout
        own, channels = len(layout.columns.extras), len(layout.joint_of)
        values = np.vstack([entries, others[:own]])
        Y = others[own : own + channels].copy()
        weight = others[own + channels :][layout.joint_of]
        weight[weight < LEAST] = 0.0
        Y[weight == 0] = 0.0
        values *= weight[layout.channel] > 0
        for e in np.flatnonzero(~layout.free):  # parameters of known value go over to Y
            Y[layout.channel[e]] -= self.known[-1 - layout.column[e]] * values[e]
        values = values[layout.free]
        if self.spool is not None:
            kept = self.spool.append(values)
        else:
            kept = values if self.double else values.astype(np.float32)
        segment = DecimatedSegment(t, kept, Y, weight)
        channel, column = layout.channel[layout.free], layout.column[layout.free]
        for j, factor in enumerate(self.factors):
            mine = channel == j
            factor.add_entries(column[mine], values[mine], Y[j], weight[j] > 0)
        return segment
