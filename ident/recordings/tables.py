"""Tables on disk as a stream of number blocks: Parquet, CSV, NPZ, MAT, HDF5.

`open_table(path)` knows the column names without reading the rows; `Table.blocks(columns)` yields
(rows, len(columns)) float arrays of some ten thousand rows, so that an hour at 1 kHz costs no more memory
than a minute (NPZ and MAT before version 7.3 are the exception: their format is read at once).
A two-dimensional array named q with n columns stands for q1..qn. Files without a header have columns
"0", "1", ... Each library is imported by the reader that needs it.
"""

from __future__ import annotations

import csv
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ident.errors import RecordingError

ROWS = 16384  # of one block: a few MB with 30 columns
HELD = 3_000_000  # numbers of a table kept after the first reading; longer tables are read again each time
Blocks = Iterator[np.ndarray]


@dataclass(frozen=True, slots=True)
class Table:
    """A table whose rows are read when asked: `blocks(names)` yields (rows, len(names)) float64 arrays."""

    file: str
    columns: tuple[str, ...]
    has_names: bool
    read: Callable[[Sequence[str]], Blocks]
    held: dict[tuple[str, ...], list[np.ndarray]] = field(default_factory=dict, repr=False, compare=False)

    def blocks(self, names: Sequence[str]) -> Blocks:
        """Blocks in order. A consumer must not write into them."""
        key = tuple(names)
        if key in self.held:
            yield from self.held[key]
            return
        kept: list[np.ndarray] = []
        size = 0
        try:
            for block in self.read(names):
                size += block.size
                if size <= HELD:
                    kept.append(block)
                else:
                    kept.clear()
                yield block
        except RecordingError:
            raise
        except Exception as error:  # the libraries raise many kinds; all mean that the file is damaged
            raise _damaged(self.file, error) from None
        if size <= HELD:
            self.held[key] = kept


def open_table(path: Path, decimal: str = ".") -> Table:
    """Open a recording. Raises RecordingError naming the file and the remedy."""
    file = str(path)
    if not path.is_file():
        what = (
            "is a folder, not a recording"
            if path.is_dir()
            else "there is no such file; check the path in the study"
        )
        raise RecordingError(file, what)
    readers: dict[str, Callable[[Path, str], Table]] = {
        ".parquet": _parquet,
        ".pq": _parquet,
        ".csv": _csv,
        ".txt": _csv,
        ".tsv": _csv,
        ".dat": _csv,
        ".npz": _npz,
        ".npy": _npz,
        ".mat": _mat,
        ".h5": _hdf5,
        ".hdf5": _hdf5,
        ".hdf": _hdf5,
    }
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise RecordingError(
            file,
            f"the ending {path.suffix or '(none)'} is not known; "
            "convert it to Parquet, CSV, NPZ, MAT or HDF5",
        )
    if path.stat().st_size == 0:
        raise RecordingError(file, "is empty; record or copy it again")
    try:
        return reader(path, decimal)
    except RecordingError:
        raise
    except Exception as error:
        raise _damaged(file, error) from None


def _damaged(file: str, error: Exception) -> RecordingError:
    reason = " ".join(str(error).split())[:160] or type(error).__name__
    return RecordingError(
        file,
        f"cannot be read as {Path(file).suffix.lstrip('.').upper()}, it looks truncated or "
        f"damaged ({reason}); copy or export it again",
    )


def _parquet(path: Path, decimal: str) -> Table:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as opened:
        names = tuple(opened.schema_arrow.names)

    def read(columns: Sequence[str]) -> Blocks:
        with pq.ParquetFile(path, pre_buffer=False, buffer_size=1 << 17) as opened:
            for batch in opened.iter_batches(
                batch_size=ROWS, columns=list(dict.fromkeys(columns)), use_threads=False
            ):
                yield np.column_stack([_numbers(str(path), name, batch.column(name)) for name in columns])

    return Table(str(path), names, True, read)


def _numbers(file: str, name: str, column: Any) -> np.ndarray:
    try:
        return np.asarray(column.to_numpy(zero_copy_only=False), float)
    except (TypeError, ValueError):
        raise RecordingError(
            file, f"column {name} is not numeric ({column.type}); export it as numbers"
        ) from None


def _csv(path: Path, decimal: str) -> Table:
    """CSV, comma, semicolon, tab or blank separated, with or without one header line."""
    import pyarrow as pa
    import pyarrow.csv as pc

    with path.open(encoding="utf-8-sig", errors="replace", newline="") as lines:
        head = [line for line in itertools.islice(lines, 20) if line.strip()]
    if not head:
        raise RecordingError(str(path), "is empty; record or copy it again")
    separator = next((mark for mark in "\t;" if mark in head[0]), None)
    if separator is None:
        separator = "," if "," in head[0] else " "
    split = [next(csv.reader([line.strip()], delimiter=separator, skipinitialspace=True)) for line in head]
    named = not all(_is_number(cell, decimal) for cell in split[0])
    rows = split[1:] if named else split
    _refuse_decimal_comma(str(path), separator, decimal, split[0] if named else None, rows)
    width = len(split[0])
    names = (
        tuple(cell.strip().strip('"') for cell in split[0]) if named else tuple(str(k) for k in range(width))
    )
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise RecordingError(str(path), f"two columns are called {twice}; rename one")
    skip = 1 if named else 0

    def read(columns: Sequence[str]) -> Blocks:
        if separator == " ":  # runs of blanks: not what a CSV parser splits
            yield from _blank_separated(path, skip, [names.index(name) for name in columns])
            return
        options = pc.ReadOptions(column_names=list(names), skip_rows=skip, block_size=1 << 21)
        convert = pc.ConvertOptions(
            column_types={name: pa.float64() for name in columns},
            decimal_point=decimal,
            include_columns=list(dict.fromkeys(columns)),
            null_values=["", "nan", "NaN", "NAN", "NA", "null"],
        )
        with pc.open_csv(path, options, pc.ParseOptions(delimiter=separator), convert) as reader:
            for batch in reader:
                yield np.column_stack([_numbers(str(path), name, batch.column(name)) for name in columns])

    return Table(str(path), names, named, read)


def _blank_separated(path: Path, skip: int, indices: list[int]) -> Blocks:
    with path.open(encoding="utf-8-sig") as lines:
        rows = itertools.islice(lines, skip, None)
        while block := list(itertools.islice(rows, ROWS)):
            yield np.loadtxt(block, ndmin=2)[:, indices]


def _is_number(cell: str, decimal: str = ".") -> bool:
    try:
        float(cell.strip().strip('"').replace(decimal, ".") or "nan")
    except ValueError:
        return False
    return True


def _refuse_decimal_comma(
    file: str, separator: str, decimal: str, header: list[str] | None, rows: list[list[str]]
) -> None:
    """A comma that stands for the decimal point must not be taken for a separator, nor for text."""
    remedy = (
        "write decimal points, or separate by semicolons and say decimal: ',' beside the file in the study"
    )
    if header is not None and separator == "," and any(len(row) > len(header) for row in rows):
        ratio = max(len(row) for row in rows) / len(header)
        if ratio > 1.4:
            raise RecordingError(
                file,
                f"the rows have more cells than the header, as when numbers are written with "
                f"a decimal comma; {remedy}",
            )
    if decimal == "." and separator != ",":
        for row in rows:
            for cell in row:
                if "," in cell and not _is_number(cell) and _is_number(cell, ","):
                    raise RecordingError(
                        file, f"numbers are written with a decimal comma ({cell.strip()}); {remedy}"
                    )


def _from_arrays(path: Path, arrays: dict[str, np.ndarray]) -> Table:
    """Named arrays as one table: (N,) columns, (N, n) or (n, N) arrays spread over name1..namen."""
    flat: dict[str, np.ndarray] = {}
    lengths = [array.shape[0] for array in arrays.values() if array.ndim == 1 or 1 in array.shape]
    numeric = {name: array for name, array in arrays.items() if array.dtype.kind in "fiub" and array.size > 1}
    lengths = [max(array.shape) for array in numeric.values() if array.ndim <= 2]
    if not lengths:
        raise RecordingError(str(path), "holds no numeric table; save t, q, tau_m or tau_l arrays in it")
    n_rows = max(lengths)
    for name, array in numeric.items():
        if array.ndim > 2 or n_rows not in array.shape:
            continue
        table = array.reshape(n_rows, -1) if array.shape[0] == n_rows else array.T
        if table.shape[1] == 1:
            flat[name] = table[:, 0]
        else:
            flat |= {f"{name}{k + 1}": table[:, k] for k in range(table.shape[1])}
    if len(numeric) == 1 and len(flat) > 1:  # one matrix, no names: columns by index
        flat = {str(k): column for k, column in enumerate(flat.values())}
    return _in_memory(path, flat)


def _in_memory(path: Path, flat: dict[str, np.ndarray]) -> Table:
    def read(columns: Sequence[str]) -> Blocks:
        n_rows = len(flat[columns[0]])
        for start in range(0, n_rows, ROWS):
            yield np.column_stack([np.asarray(flat[name][start : start + ROWS], float) for name in columns])

    return Table(str(path), tuple(flat), not all(name.isdigit() for name in flat), read)


def _npz(path: Path, decimal: str) -> Table:
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return _from_arrays(path, {"table": loaded})
    with loaded:
        return _from_arrays(path, {name: loaded[name] for name in loaded.files})


def _mat(path: Path, decimal: str) -> Table:
    with path.open("rb") as opened:
        if b"MATLAB 7.3" in opened.read(128):
            return _hdf5(path, decimal)
    import scipy.io

    loaded = scipy.io.loadmat(path)
    return _from_arrays(
        path, {name: np.asarray(value) for name, value in loaded.items() if not name.startswith("__")}
    )


def _hdf5(path: Path, decimal: str) -> Table:
    """Datasets at any depth (the last part of their path is the name), read slice by slice."""
    import h5py

    places: dict[str, tuple[str, int | None, bool]] = {}  # column: dataset, index in it, transposed
    with h5py.File(path, "r") as opened:
        found: dict[str, tuple[str, tuple[int, ...]]] = {}
        opened.visititems(
            lambda name, item: (
                found.__setitem__(name.rsplit("/", 1)[-1], (name, item.shape))
                if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and item.ndim in (1, 2)
                else None
            )
        )
    if not found:
        raise RecordingError(str(path), "holds no numeric dataset; save t, q, tau_m or tau_l in it")
    n_rows = max(max(shape) for _, shape in found.values())
    for name, (where, shape) in found.items():
        if n_rows not in shape:
            continue
        flipped = shape[0] != n_rows
        width = 1 if len(shape) == 1 else shape[0 if flipped else 1]
        if width == 1:
            places[name] = (where, None if len(shape) == 1 else 0, flipped)
        else:
            only = len(found) == 1
            places |= {str(k) if only else f"{name}{k + 1}": (where, k, flipped) for k in range(width)}

    def read(columns: Sequence[str]) -> Blocks:
        with h5py.File(path, "r") as opened:
            for start in range(0, n_rows, ROWS):
                rows = slice(start, start + ROWS)
                block = []
                for name in columns:
                    where, k, flipped = places[name]
                    data = opened[where]
                    block.append(data[rows] if k is None else data[k, rows] if flipped else data[rows, k])
                yield np.column_stack(block).astype(float)

    return Table(str(path), tuple(places), not all(name.isdigit() for name in places), read)
