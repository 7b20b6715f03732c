"""Contiguous pieces of a table spread over its whole length, in constant memory."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

PIECE = 2048  # rows
PIECES = 48
Block = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(slots=True)
class Excerpt:
    """Takes every k-th piece; k doubles when there are too many."""

    pieces: list[Block] = field(default_factory=list)
    every: int = 1
    _seen: int = 0

    def take(self, block: Block) -> None:
        for start in range(0, len(block[0]), PIECE):
            if self._seen % self.every == 0:
                rows = slice(start, start + PIECE)  # copied: a view would hold its whole block
                self.pieces.append(tuple(part[rows].copy() for part in block))  # type: ignore[arg-type]
            self._seen += 1
        if len(self.pieces) > PIECES:
            self.pieces = self.pieces[::2]
            self.every *= 2

    def column(self, k: int) -> np.ndarray:
        """(N,) of all pieces."""
        return np.concatenate([values[:, k] for _, _, values in self.pieces])
