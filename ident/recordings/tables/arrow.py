"""Arrow columns as numbers: Parquet files, and anything in memory that hands out Arrow data.

List columns (`observation.state` of a robot learning data set, `qpos` of a simulator's log) are spread over
name1..namen as two-dimensional arrays are elsewhere. Dates become seconds since the first row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ident.errors import RecordingError
from ident.recordings import held
from ident.recordings.tables import table as of
from ident.recordings.tables.table import Blocks, Table, not_numeric

FIRST = 256  # rows that tell how long the lists are


def parquet(path: Path) -> Table:
    """A Parquet file, read row group by row group."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path, pre_buffer=False, buffer_size=1 << 17) as opened:
        schema = opened.schema_arrow
        lists = [column.name for column in schema if _is_list(column.type)]
        rows = opened.iter_batches(batch_size=FIRST, columns=lists, use_threads=False)
        first = next(rows, None) if lists else None

    def batches(columns: list[str]) -> Iterable[Any]:
        with pq.ParquetFile(path, pre_buffer=False, buffer_size=1 << 17) as opened:
            groups = [opened.metadata.row_group(k).num_rows for k in range(opened.num_row_groups)]
            if max(groups, default=0) * len(columns) <= held.NUMBERS:
                yield from (_Group(opened, k, rows) for k, rows in enumerate(groups))
            else:
                yield from opened.iter_batches(batch_size=of.ROWS, columns=columns, use_threads=False)

    return arrow_table(str(path), schema, first, batches)


@dataclass(frozen=True, slots=True)
class _Group:
    """A row group as a batch whose columns are read one at a time: reading all together holds the pages of
    all, 50 MB of 22 columns, and takes four times as long."""

    opened: Any
    number: int
    num_rows: int

    def column(self, name: str) -> Any:
        read = self.opened.read_row_group(self.number, columns=[name], use_threads=False).column(name)
        return read.chunk(0) if read.num_chunks == 1 else read.combine_chunks()


def arrow_table(file: str, schema: Any, first: Any, batches: Callable[[list[str]], Iterable[Any]]) -> Table:
    """`batches(columns)` yields record batches from the first row on; `first` holds at least one row or is
    None."""
    twice = {name for name in schema.names if schema.names.count(name) > 1}
    if twice:
        raise RecordingError(file, f"two columns are called {min(twice)}; rename one")
    places: dict[str, tuple[str, int | None]] = {}  # column -> Arrow column, index in its list
    for column in schema:
        width = _width(column, first)
        if width is None:
            places[column.name] = (column.name, None)
        else:
            places |= {f"{column.name}{k + 1}": (column.name, k) for k in range(width)}

    def read(columns: Sequence[str]) -> Blocks:
        wanted: dict[str, list[tuple[int, int | None]]] = {}  # Arrow column -> where to, index in its list
        for at, name in enumerate(columns):
            wanted.setdefault(places[name][0], []).append((at, places[name][1]))
        origins: dict[str, Any] = {}
        for batch in batches(list(wanted)):
            out = np.empty((len(columns), batch.num_rows))
            for name, its in wanted.items():
                values = numbers(file, name, batch.column(name), origins)
                for at, k in its:
                    out[at] = values if k is None else values[:, k]
            for start in range(0, batch.num_rows, of.ROWS):
                yield out[:, start : start + of.ROWS].T

    return Table(file, tuple(places), True, read)


def _is_list(kind: Any) -> bool:
    import pyarrow.types as types

    return bool(types.is_fixed_size_list(kind) or types.is_list(kind) or types.is_large_list(kind))


def _width(column: Any, first: Any) -> int | None:
    """Numbers in each cell of a list column; None for a column of single values."""
    import pyarrow.types as types

    if types.is_fixed_size_list(column.type):
        return int(column.type.list_size)
    if not _is_list(column.type):
        return None
    if first is None:
        return 0
    return int(
        first.column(column.name).value_lengths().fill_null(0).to_numpy(zero_copy_only=False).max(initial=0)
    )


def numbers(file: str, name: str, column: Any, origins: dict[str, Any]) -> np.ndarray:
    """(rows,) of single values, (rows, n) of lists; nulls become NaN. `origins` keeps each date column's
    first value from batch to batch."""
    import pyarrow as pa
    import pyarrow.types as types

    if _is_list(column.type):
        return _lists(file, name, column, origins)
    if types.is_timestamp(column.type) or types.is_duration(column.type):
        per_second = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[column.type.unit]
        ticks = column.cast(pa.int64())
        known = ticks.drop_null()
        if types.is_timestamp(column.type) and name not in origins and len(known):
            origins[name] = known[0].as_py()
        since = ticks.fill_null(0).to_numpy(zero_copy_only=False) - origins.get(name, 0)
        return np.where(column.is_null().to_numpy(zero_copy_only=False), np.nan, since / per_second)
    if types.is_integer(column.type) or types.is_float64(column.type) or types.is_float32(column.type):
        return _plain(column)
    if types.is_boolean(column.type):
        raise not_numeric(file, name, "truth values")
    if types.is_decimal(column.type) or types.is_float16(column.type):
        column = column.cast(pa.float64())
    try:
        return np.asarray(column.to_numpy(zero_copy_only=False), float)
    except (TypeError, ValueError):
        raise not_numeric(file, name, str(column.type)) from None


def _plain(column: Any) -> np.ndarray:
    """(rows,) of integers or floats by Arrow's own buffer: `to_numpy` would import pandas, 40 MB, `cast`
    pyarrow.compute."""
    validity, data = column.buffers()
    if data is None:
        return np.zeros(0)
    here = slice(column.offset, column.offset + len(column))
    out = np.frombuffer(data, column.type.to_pandas_dtype())[here].astype(float, copy=False)
    if not column.null_count:
        return out
    bits = np.unpackbits(np.frombuffer(validity, np.uint8), bitorder="little")
    present = bits[column.offset : column.offset + len(column)].astype(bool)
    return np.where(present, out, np.nan)


def _lists(file: str, name: str, column: Any, origins: dict[str, Any]) -> np.ndarray:
    """Lists of one length as (rows, n); a row without a list is NaN throughout."""
    lengths = column.value_lengths().fill_null(-1).to_numpy(zero_copy_only=False)
    width = int(lengths.max(initial=0))
    present = lengths >= 0
    if not (lengths[present] == width).all():
        raise RecordingError(
            file,
            f"column {name} holds lists of different lengths; export lists of one length, one number a joint",
        )
    out = np.full((len(lengths), width), np.nan)
    out[present] = numbers(file, name, column.drop_null().flatten(), origins).reshape(-1, width)
    return out
