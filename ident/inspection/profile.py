"""What the columns of one table hold, each for itself: range, grid, noise, holes; no meaning is given yet.

One pass in constant memory; grid and noise are read off contiguous pieces spread over the whole table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ident.errors import RecordingError
from ident.examination.tables.excerpt import Excerpt
from ident.recordings.tables import Table

MOST_COLUMNS = 400


@dataclass(frozen=True, slots=True)
class ColumnProfile:
    """Values as they stand in the file. `grid`: step between values where they lie on one, else 0; `noise`:
    standard deviation of what no smooth curve follows."""

    name: str
    unit: str
    lowest: float
    highest: float
    missing: int
    grid: float
    noise: float

    @property
    def constant(self) -> bool:
        return not self.highest > self.lowest


@dataclass(frozen=True, slots=True)
class TableProfile:
    """Columns that are numbers, names of those that are not, and pieces of the rows, (N, columns) each."""

    file: str
    rows: int
    columns: tuple[ColumnProfile, ...]
    text: tuple[str, ...]
    pieces: tuple[np.ndarray, ...]
    remarks: tuple[str, ...]

    def column(self, name: str) -> ColumnProfile | None:
        return next((column for column in self.columns if column.name == name), None)

    @property
    def units(self) -> dict[str, str]:
        """Of the columns whose unit the file states."""
        return {column.name: column.unit for column in self.columns if column.unit}

    def pieces_of(self, name: str) -> list[np.ndarray]:
        """(N,) of a column, piece by piece."""
        k = [column.name for column in self.columns].index(name)
        return [piece[:, k] for piece in self.pieces]

    def values(self, name: str) -> np.ndarray:
        """(N,) of the pieces together."""
        return np.concatenate(self.pieces_of(name))


def profile(table: Table) -> TableProfile:
    """Read a table once. Raises RecordingError where it holds no rows of numbers."""
    names = list(table.columns[:MOST_COLUMNS])
    text: list[str] = []
    if not _is_readable(table, names):
        text = [name for name in names if not _is_readable(table, [name])]
        names = [name for name in names if name not in text]
    if not names:
        raise RecordingError(table.file, "holds no column of numbers; export numbers")
    excerpt = Excerpt()
    rows, missing = 0, np.zeros(len(names), int)
    lowest, highest = np.full(len(names), np.inf), np.full(len(names), -np.inf)
    for block in table.blocks(names):
        holes = ~np.isfinite(block)
        missing += holes.sum(axis=0)
        lowest = np.minimum(lowest, np.where(holes, np.inf, block).min(axis=0, initial=np.inf))
        highest = np.maximum(highest, np.where(holes, -np.inf, block).max(axis=0, initial=-np.inf))
        numbers = np.arange(rows, rows + len(block))
        excerpt.take((numbers, numbers, block))
        rows += len(block)
    if rows == 0:
        raise RecordingError(table.file, "holds no rows; record again")
    pieces = tuple(values for _, _, values in excerpt.pieces)
    columns = tuple(
        ColumnProfile(
            name,
            table.units.get(name, ""),
            float(lowest[k]),
            float(highest[k]),
            int(missing[k]),
            grid([piece[:, k] for piece in pieces]),
            noise([piece[:, k] for piece in pieces]),
        )
        for k, name in enumerate(names)
    )
    return TableProfile(
        table.file, rows, columns, tuple(text), pieces, (*table.remarks, *filter(None, [table.cut]))
    )


def _is_readable(table: Table, names: list[str]) -> bool:
    """Whether the first rows of these columns are numbers."""
    try:
        next(iter(table.blocks(names)), None)
    except RecordingError:
        return False
    return True


def grid(pieces: list[np.ndarray]) -> float:
    """The step on whose multiples all values lie, 0 where there is none that is coarse enough to see."""
    x = np.concatenate(pieces)
    x = x[np.isfinite(x)]
    levels = np.unique(x)
    if len(levels) < 3 or len(levels) > 0.5 * len(x):
        return 0.0
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * np.abs(levels).max()]
    if not len(steps):
        return 0.0
    step = float(np.median(steps[steps < 1.5 * steps.min()]))
    return step if (np.abs(steps / step - np.rint(steps / step)) < 0.05).mean() > 0.95 else 0.0


def noise(pieces: list[np.ndarray]) -> float:
    """Of the third differences, which smooth motion leaves next to nothing in (20 = 1 + 9 + 9 + 1)."""
    known = [np.where(np.isfinite(piece), piece, np.nan) for piece in pieces if len(piece) > 3]
    thirds = [np.diff(piece, 3) for piece in known]
    x = np.concatenate(thirds) if thirds else np.empty(0)
    x = x[np.isfinite(x)]
    return float(1.4826 * np.median(np.abs(x)) / np.sqrt(20)) if len(x) else 0.0
