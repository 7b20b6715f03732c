"""Contiguous pieces of a table spread over its whole length, in constant memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ident.examination.tables.clock import PAUSE

PIECE = 2048  # rows
PIECES = 48
Block = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(slots=True)
class Excerpt:
    """Takes every k-th piece; k doubles when there are too many."""

    pieces: list[Block] = field(default_factory=list)
    every: int = 1
    _seen: int = 0
    _columns: np.ndarray | None = None

    def take(self, block: Block) -> None:
        for start in range(0, len(block[0]), PIECE):
            if self._seen % self.every == 0:
                rows = slice(start, start + PIECE)  # copied: a view would hold its whole block
                self.pieces.append(tuple(part[rows].copy() for part in block))  # type: ignore[arg-type]
            self._seen += 1
        if len(self.pieces) > PIECES:
            self.pieces = self.pieces[::2]
            self.every *= 2

    def stretches(self, k: int, j: int) -> Iterator[Block]:
        """Rows, t and two columns (N, 2) of the pieces, those that follow each other without a pause as one.
        (Of an LWR4+ that pauses for a second the filter was not lowered for its steps that is lowered, and
        they were told to make 67 % of an acceleration.)"""
        x = np.stack([self.column(k), self.column(j)], axis=1)
        rows, t = (np.concatenate([piece[i] for piece in self.pieces]) for i in (0, 1))
        ends = np.union1d(np.flatnonzero(np.diff(rows) != 1) + 1, resumed(t))
        yield from zip(*(np.split(part, ends) for part in (rows, t, x)))

    def unpaused(self) -> Iterator[Block]:
        """The pieces, cut where the stamps pause: what follows is another motion, or this one later on."""
        for piece in self.pieces:
            yield from zip(*(np.split(part, resumed(piece[1])) for part in piece))

    def reach(self, k: int) -> float:
        """How far a column goes at most without a pause. (A UR10e that stands in ten poses does not move.)"""
        x = self.column(k)
        rows, t = (np.concatenate([piece[i] for piece in self.pieces]) for i in (0, 1))
        return max(float(np.ptp(part)) for part in np.split(x, resumed(t, rows)))

    def column(self, k: int) -> np.ndarray:
        """(N,) of all pieces, as taken up to the first question; not to be written into."""
        if self._columns is None:  # column by column in memory, and the pieces views of it
            ends = np.cumsum([len(rows) for rows, _, _ in self.pieces])
            self._columns = np.empty((self.pieces[0][2].shape[1], ends[-1]))
            for place, (end, (rows, t, values)) in enumerate(zip(ends, self.pieces)):
                own = self._columns[:, end - len(rows) : end]
                own[:] = values.T
                self.pieces[place] = rows, t, own.T
        column: np.ndarray = self._columns[k]
        return column

    def fewer(self, k: int, count: int) -> bool:
        """Whether a column holds fewer than `count` different values; a part of it usually says no."""
        x = self.column(k)
        return len(np.unique(x[:PIECE])) < count and len(np.unique(x)) < count


def resumed(t: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
    """(K,) where stamps t (N,) go on after a pause; rows (N,) of the table, where some are not among them."""
    steps = np.diff(t) / (1 if rows is None else np.diff(rows))
    positive = steps[steps > 0]
    usual = float(np.median(positive)) if len(positive) else np.inf
    return np.flatnonzero(steps > PAUSE * usual) + 1
