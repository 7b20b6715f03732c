"""What is kept of Y = W chi + rho: decimated rows and one triangular factor per channel (paper eq. 9 to 12).

Decimated rows are pushed into an upper triangular factor per channel,

    R = qr([W_j Y_j]),   ||Y_j - W_j chi|| = ||R [chi; -1]||  for every chi,

over the columns that are structurally non-zero in that channel. Least squares, weights chosen afterwards,
F-statistics and the removal of columns need no more than these factors. They are kept per recording: factors
of several recordings stack, so errors of one recording, and what one recording excites, come from the same
values. The decimated rows themselves (2.5 x cut-off per second) are kept for what depends on their order:
autocorrelation, Durbin-Watson, Huber weights; many wait on disk (spilled.py), and are read in pieces.
build.py makes them from recordings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.equations.spilled import SpilledRows

STACK = 512  # decimated rows gathered before a factor takes them in
LEAST = 0.1  # share of a row's samples that must count
PIECE = 8192  # decimated rows that are looked at together


@dataclass(frozen=True, slots=True)
class ChannelFactor:
    """R (c+1, c+1) of one channel's [W_j Y_j]; columns (c,) are positions among the study's parameters."""

    columns: np.ndarray
    R: np.ndarray
    rows: int

    def sum_of_squares(self, chi: np.ndarray) -> float:
        """||Y_j - W_j chi||^2."""
        return float(np.sum((self.R[:, :-1] @ chi[self.columns] - self.R[:, -1]) ** 2))


@dataclass(frozen=True, slots=True)
class DecimatedSegment:
    """Decimated rows of one segment: t (m,), values (E, m) of W's entries, Y (channels, m).

    weight (channels, m) is the share of a row's samples that count (filtering.py: certain); rows below
    LEAST are zero throughout and not counted.
    """

    t: np.ndarray
    values: np.ndarray | SpilledRows
    Y: np.ndarray
    weight: np.ndarray
    index: int = 0  # of the stretch in its recording

    @property
    def used(self) -> np.ndarray:
        """(channels, m) bool: rows that count."""
        return self.weight > 0

    def pieces(self, more: int = 0) -> Iterator[tuple[slice, DecimatedSegment]]:
        """At most PIECE rows at a time and up to `more` of those after them, in memory; the slice is of the
        rows without them."""
        for start in range(0, len(self.t), PIECE):
            rows = slice(start, start + PIECE + more)
            part = replace(
                self,
                t=self.t[rows],
                values=self.values[:, rows],
                Y=self.Y[:, rows],
                weight=self.weight[:, rows],
            )
            yield slice(start, min(start + PIECE, len(self.t))), part


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
        for rows, piece in segment.pieces():
            for j in range(len(out)):
                mine = self.channel == j
                out[j, rows] = chi[self.column[mine]] @ piece.values[mine]
        return out

    def residuals(self, chi: np.ndarray) -> list[np.ndarray]:
        """Y - W chi, (channels, m) for each segment."""
        return [segment.Y - self.predicted(segment, chi) for segment in self.segments]

    def dense(self, segment: DecimatedSegment, j: int, b: int) -> np.ndarray:
        """W_j (m, b) of one segment."""
        mine = self.channel == j
        W = np.zeros((len(segment.t), b))
        np.add.at(W.T, self.column[mine], segment.values[mine])
        return W


class GrowingFactor:
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

    def add_entries(self, column: np.ndarray, values: np.ndarray, Y: np.ndarray, used: np.ndarray) -> None:
        """Rows from entries: values (E, m) of these columns (E,), Y (m,); only those in use (m,)."""
        rows = np.zeros((len(Y), len(self.columns) + 1))
        np.add.at(rows.T, np.searchsorted(self.columns, column), values)
        rows[:, -1] = Y
        self.add(rows[used])

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
