"""From recordings to triangular factors: Y = W chi + rho, decimated, one R per channel (paper eq. 9 to 12).

A block of filtered samples is evaluated (the non-zero entries of W only), decimated, and its decimated rows
are pushed into an upper triangular factor per channel,

    R = qr([W_j Y_j]),   ||Y_j - W_j chi|| = ||R [chi; -1]||  for every chi,

over the columns that are structurally non-zero in that channel. Least squares, weights chosen afterwards,
F-statistics and the removal of columns need no more than these factors. They are kept per recording: factors
of several recordings stack, so errors of one recording, and what one recording excites, come from the same
values. The decimated rows themselves (2.5 x cut-off per second) are kept for what depends on their order:
autocorrelation, Durbin-Watson, Huber weights.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ident.equations.columns import Columns
from ident.errors import NotEnoughDataError
from ident.recordings.recording import RecordingStream
from ident.signals.decimation import Decimator, kept_every
from ident.signals.filtering import FilterBank, LowPass, filter_stream

STACK = 512  # decimated rows gathered before a factor takes them in
LEAST = 0.1  # share of a row's samples that must count
HELD = 2_000_000  # decimated entries of a recording that are held in double precision; longer ones in single
Tick = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class ChannelFactor:
    """R (c+1, c+1) of one channel's [W_j Y_j]; columns (c,) are positions among the study's parameters."""

    columns: np.ndarray
    R: np.ndarray
    rows: int

    def sum_of_squares(self, chi: np.ndarray) -> float:
        """||Y_j - W_j chi||^2."""
        return float(np.sum((self.R[:, :-1] @ chi[self.columns] - self.R[:, -1]) ** 2))

    @property
    def norm2(self) -> float:
        """||Y_j||^2."""
        return float(np.sum(self.R[:, -1] ** 2))


@dataclass(frozen=True, slots=True)
class DecimatedSegment:
    """Decimated rows of one segment: t (m,), values (E, m) of W's entries, Y (channels, m).

    weight (channels, m) is the share of a row's samples that count (filtering.py: certain); rows below
    LEAST are zero throughout and not counted.
    """

    t: np.ndarray
    values: np.ndarray
    Y: np.ndarray
    weight: np.ndarray

    @property
    def used(self) -> np.ndarray:
        """(channels, m) bool: rows that count."""
        return self.weight > 0


@dataclass(frozen=True, slots=True)
class RecordingSystem:
    """One recording's equations: a factor per channel and its decimated rows, segment by segment."""

    label: str
    role: str
    payload: str | None
    channel: np.ndarray  # (E,) of each entry
    column: np.ndarray  # (E,)
    factors: tuple[ChannelFactor, ...]
    segments: tuple[DecimatedSegment, ...]
    samples: int  # uniform samples that went in

    @property
    def rows(self) -> int:
        return sum(factor.rows for factor in self.factors)

    def predicted(self, segment: DecimatedSegment, chi: np.ndarray) -> np.ndarray:
        """W chi of one segment, (channels, m)."""
        out = np.zeros_like(segment.Y)
        for j in range(len(out)):
            mine = self.channel == j
            out[j] = chi[self.column[mine]] @ segment.values[mine]
        return out

    def residuals(self, chi: np.ndarray) -> list[np.ndarray]:
        """Y - W chi, (channels, m) for each segment."""
        return [segment.Y - self.predicted(segment, chi) for segment in self.segments]

    def dense(self, segment: DecimatedSegment, j: int, b: int) -> np.ndarray:
        """W_j (m, b) of one segment."""
        mine = self.channel == j
        W = np.zeros((len(segment.t), b))
        W[:, self.column[mine]] = segment.values[mine].T
        return W


class _Growing:
    """An R factor that takes rows in: stacked under R and triangularised again every STACK rows."""

    def __init__(self, columns: np.ndarray) -> None:
        self.columns, self.rows = columns, 0
        self.R = np.zeros((0, len(columns) + 1))
        self.pending: list[np.ndarray] = []
        self.waiting = 0

    def add(self, rows: np.ndarray) -> None:
        self.pending.append(rows)
        self.waiting += len(rows)
        self.rows += len(rows)
        if self.waiting >= STACK:
            self._take_in()

    def _take_in(self) -> None:
        if not self.pending:
            return
        self.R = triangular(np.vstack([self.R, *self.pending]))
        self.pending, self.waiting = [], 0

    def factor(self) -> ChannelFactor:
        self._take_in()
        return ChannelFactor(self.columns, self.R, self.rows)


def triangular(rows: np.ndarray) -> np.ndarray:
    """R of a QR factorisation (at most as many rows as columns)."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


def observe(
    stream: RecordingStream,
    bank: FilterBank,
    columns: Columns,
    cutoff_hz: float,
    order: int = 4,
    tick: Tick | None = None,
    excerpt_s: float = np.inf,
) -> RecordingSystem:
    """Evaluate, decimate and factor one recording, or its first `excerpt_s` seconds of motion.

    Raises NotEnoughDataError when nothing remains of it.
    """
    model = columns.model
    used, channel, column = columns.entries(stream.payload)
    everything = len(used) == len(model.nonzeros)
    entry_joint = channel % len(columns.need.joints)
    channel = np.concatenate([channel, [extra.channel for extra in columns.extras]]).astype(int)
    column = np.concatenate([column, [extra.column for extra in columns.extras]]).astype(int)
    free = column >= 0
    n_channels = len(columns.channels)
    known = np.array(list(columns.known.values()))
    filter = LowPass(cutoff_hz, stream.rate_hz, order)
    every = kept_every(cutoff_hz, stream.rate_hz)
    growing = [_Growing(np.unique(column[free & (channel == j)])) for j in range(n_channels)]
    segments: list[DecimatedSegment] = []
    samples = 0
    few = stream.survey.rows / every * len(channel) < HELD  # R is double in any case

    parts_t: list[np.ndarray] = []
    parts_W: list[np.ndarray] = []
    parts_Y: list[np.ndarray] = []
    parts_weight: list[np.ndarray] = []
    n_joints = len(columns.need.joints)
    joint_of = np.arange(n_channels) % n_joints
    kept = 0
    t_first = 0.0

    def take(W_part: np.ndarray | None, other: np.ndarray | None) -> None:
        nonlocal kept
        if W_part is None or other is None or not W_part.shape[1]:
            return
        n_extra = len(columns.extras)
        W = np.vstack([W_part, other[:n_extra]])
        Y = other[n_extra : n_extra + n_channels].copy()
        weight = other[n_extra + n_channels :][joint_of]
        weight[weight < LEAST] = 0.0
        Y[weight == 0] = 0.0
        W *= weight[channel] > 0
        for e in np.flatnonzero(~free):  # parameters of known value go over to Y
            Y[channel[e]] -= known[-1 - column[e]] * W[e]
        W = W[free]
        m = W.shape[1]
        for j, factor in enumerate(growing):
            mine = channel[free] == j
            rows = np.zeros((m, len(factor.columns) + 1))
            places = np.searchsorted(factor.columns, column[free][mine])
            np.add.at(rows.T, places, W[mine])
            rows[:, -1] = Y[j]
            factor.add(rows[weight[j] > 0])
        parts_t.append(t_first + (np.arange(kept, kept + m) + 1) * every / stream.rate_hz)
        parts_W.append(W if few else W.astype(np.float32))
        parts_Y.append(Y)
        parts_weight.append(weight)
        kept += m

    def finish(fold_W: Decimator, fold_rest: Decimator) -> None:
        take(fold_W.finish(), fold_rest.finish())
        if parts_W:
            segments.append(
                DecimatedSegment(
                    np.concatenate(parts_t), np.hstack(parts_W), np.hstack(parts_Y), np.hstack(parts_weight)
                )
            )
        for parts in (parts_t, parts_W, parts_Y, parts_weight):
            parts.clear()

    folds: tuple[Decimator, Decimator] | None = None
    current = -1
    for index, block in filter_stream(stream, bank):
        if index != current:
            if folds:
                finish(*folds)
            folds = (
                Decimator(filter, every, len(used)),
                Decimator(filter, every, len(columns.extras) + n_channels + n_joints),
            )
            current, kept, t_first = index, 0, float(block.t[0]) - 1.0 / stream.rate_hz
        assert folds is not None
        certain = np.ascontiguousarray(block.certain.T)
        rest = np.vstack(
            [
                *(extra.values(block) * certain[extra.channel % n_joints] for extra in columns.extras),
                columns.torque(block).T * certain[joint_of],
                certain,
            ]
        )
        for rows, values in model.nonzero_blocks(block.q, block.dq, block.ddq, sign=block.sign_dq):
            weighted = values if everything else values[used]
            weighted = weighted * certain[:, rows][entry_joint]
            take(folds[0].push(weighted), folds[1].push(rest[:, rows]))
        samples += len(block.t)
        if tick:
            tick(len(block.t))
        if samples >= excerpt_s * stream.rate_hz:
            break
    if folds:
        finish(*folds)
    if not segments:
        raise NotEnoughDataError(
            f"{stream.file}: nothing is left of {stream.label} after rest and filter transients "
            "are cut; record longer or raise the filter's cut-off"
        )
    return RecordingSystem(
        stream.label,
        stream.role,
        stream.payload,
        channel[free],
        column[free],
        tuple(factor.factor() for factor in growing),
        tuple(segments),
        samples,
    )


def stack(systems: Sequence[RecordingSystem]) -> tuple[ChannelFactor, ...]:
    """The factors of several recordings as one, channel by channel."""
    out = []
    for parts in zip(*(system.factors for system in systems)):
        columns = np.unique(np.concatenate([part.columns for part in parts]))
        rows = []
        for part in parts:
            wide = np.zeros((len(part.R), len(columns) + 1))
            wide[:, np.searchsorted(columns, part.columns)] = part.R[:, :-1]
            wide[:, -1] = part.R[:, -1]
            rows.append(wide)
        out.append(ChannelFactor(columns, triangular(np.vstack(rows)), sum(part.rows for part in parts)))
    return tuple(out)
