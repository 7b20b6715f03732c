"""Runs of rows: of equal values, and of rows that are something."""

from __future__ import annotations

import numpy as np


def runs_of_equals(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Begin (K,) and length (K,) of the runs of equal values of x (N,)."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(x)) + 1, [len(x)]])
    return edges[:-1], np.diff(edges)


def runs_of(mine: np.ndarray) -> np.ndarray:
    """(K, 2) where runs of these rows (N,) bool begin and have ended."""
    return np.flatnonzero(np.diff(np.concatenate([[0], mine.view(np.int8), [0]]))).reshape(-1, 2)
