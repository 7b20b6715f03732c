"""A table whose rows are read when asked, and what a column must be to count as numbers.

`Table.blocks(columns)` yields (rows, len(columns)) float64 arrays of at most `ROWS` rows, so that an hour at
1 kHz costs no more memory than a minute. Empty cells and NaN arrive as NaN, any finite number as it is:
whether a recording is fit to be used is decided by who reads it. Truth values and text are no numbers and
are refused here. Times given as dates become seconds since the table's first row; durations seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ident.errors import IdentError, RecordingError
from ident.recordings.held import Held
from modelgen.errors import shortened

ROWS = 16384  # of one block: a few MB with 30 columns
MENDED_BY = {"MCAP": "mcap recover", "BAG": "rosbag reindex", "DB3": "ros2 bag reindex"}  # not closed by ROS
Blocks = Iterator[np.ndarray]


@dataclass(frozen=True, slots=True)
class Table:
    """Columns by name, rows when asked: `blocks(names)` yields (rows, len(names)) float64 arrays.

    What is `in_memory` anyway is not held a second time. `units` is what a units row says, as written;
    `remarks` are sentences on what was passed over or changed; `cut`, in words, the last row where it was not
    whole and was left out.
    """

    file: str
    columns: tuple[str, ...]
    has_names: bool
    read: Callable[[Sequence[str]], Blocks]
    units: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    cut: str = ""
    in_memory: bool = False
    held: Held = field(default_factory=Held, repr=False, compare=False)

    def blocks(self, names: Sequence[str]) -> Blocks:
        """Blocks in order. A consumer must not write into them."""
        return self._read(names) if self.in_memory else self.held.blocks(tuple(names), self._read(names))

    def _read(self, names: Sequence[str]) -> Blocks:
        try:
            yield from self.read(names)
        except IdentError:
            raise
        except Exception as error:  # the libraries raise many kinds; all mean that the file is damaged
            raise damaged(self.file, error) from None


def damaged(file: str, error: Exception) -> RecordingError:
    """What a library could not read, as one sentence."""
    reason = shortened(str(error), 160) or type(error).__name__
    kind = Path(file).suffix.lstrip(".").upper() or "a table"
    mend = f", or mend it with {MENDED_BY[kind]}" if kind in MENDED_BY else ""
    return RecordingError(
        file,
        f"cannot be read as {kind}, it looks truncated or damaged ({reason}); copy or export it again{mend}",
    )


def flattened(file: str, arrays: Mapping[str, np.ndarray]) -> Table:
    """Named arrays as one table: (N,) columns, (N, n) or (n, N) arrays spread over name1..namen."""
    numeric = {
        name: array for name, array in arrays.items() if array.dtype.kind in "fiubmM" and array.size > 1
    }
    lengths = [max(array.shape) for array in numeric.values() if array.ndim <= 2]
    if not lengths:
        raise RecordingError(file, "holds no numeric table; save t, q, tau_m or tau_l arrays in it")
    rows = max(lengths)
    flat: dict[str, np.ndarray] = {}
    for name, array in numeric.items():
        if array.ndim > 2 or rows not in array.shape:
            continue
        table = array.reshape(rows, -1) if array.shape[0] == rows else array.T
        if table.shape[1] == 1:
            flat[name] = table[:, 0]
        else:
            flat |= {f"{name}{k + 1}": table[:, k] for k in range(table.shape[1])}
    if len(numeric) == 1 and len(flat) > 1:  # one matrix, no names: columns by index
        flat = {str(k): column for k, column in enumerate(flat.values())}
    return of_columns(file, flat)


def of_columns(file: str, flat: Mapping[str, np.ndarray]) -> Table:
    """Columns of equal length that are held in memory already."""

    def read(columns: Sequence[str]) -> Blocks:
        numbers = {name: seconds_or_numbers(file, name, flat[name]) for name in dict.fromkeys(columns)}
        rows = len(next(iter(numbers.values()))) if numbers else 0
        for start in range(0, rows, ROWS):
            block = [numbers[name][start : start + ROWS] for name in columns]
            yield np.column_stack(block).astype(float, copy=False)

    return Table(file, tuple(flat), not all(name.isdigit() for name in flat), read, in_memory=True)


def seconds_or_numbers(file: str, name: str, values: np.ndarray) -> np.ndarray:
    """A whole column as numbers; dates as seconds since the first of them, durations as seconds."""
    if values.dtype.kind in "fiu":
        return values
    if values.dtype.kind in "mM" and len(values):
        first = values[np.flatnonzero(~np.isnat(values))[:1]]
        since = values - first[0] if values.dtype.kind == "M" and len(first) else values
        return np.where(np.isnat(values), np.nan, since / np.timedelta64(1, "s"))
    raise not_numeric(file, name, "truth values" if values.dtype.kind == "b" else str(values.dtype))


def not_numeric(file: str, name: str, kind: str) -> RecordingError:
    return RecordingError(file, f"column {name} is not numeric ({kind}); export it as numbers")
