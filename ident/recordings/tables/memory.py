"""A table that is in memory already: a dict of arrays, a data frame, Arrow data.

Data frames of any library are read through Arrow's C stream or the data frame interchange protocol, so that
none of them is a dependency. A dict's (N, n) arrays stand for name1..namen.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ident.errors import RecordingError
from ident.recordings.tables import table as of
from ident.recordings.tables.arrow import FIRST, arrow_table
from ident.recordings.tables.table import Table, flattened


def in_memory(source: Any, name: str) -> Table:
    """`name` stands for the file in messages. Raises RecordingError for what is no table."""
    if isinstance(source, Mapping):
        return _of_arrays(source, name)
    if hasattr(source, "__arrow_c_stream__") or hasattr(source, "__dataframe__"):
        return _of_frame(source, name)
    raise RecordingError(
        name,
        f"is {type(source).__name__}, not a table; "
        "give a path, a dict of arrays, a data frame or an Arrow table",
    )


def _of_arrays(source: Mapping[Any, Any], name: str) -> Table:
    arrays: dict[str, np.ndarray] = {}
    for key, values in source.items():
        try:
            array = np.asarray(values)
        except ValueError:
            raise RecordingError(name, f"{key} is ragged; give arrays of one length") from None
        if array.dtype.kind == "O":
            array = _objects(name, str(key), array)
        if array.dtype.kind not in "fiumMb":
            raise RecordingError(name, f"{key} is not numeric ({array.dtype}); give numbers")
        if array.ndim not in (1, 2):
            raise RecordingError(name, f"{key} has shape {array.shape}; give (N,) or (N, joints)")
        arrays[str(key)] = array
    if not arrays:
        raise RecordingError(name, "is empty; give at least t, q and torques")
    lengths = {key: len(array) for key, array in arrays.items()}
    rows = next(iter(lengths.values()))
    for key, length in lengths.items():
        if length != rows:
            raise RecordingError(
                name, f"{key} has {length} rows, {next(iter(lengths))} has {rows}; give arrays of one length"
            )
    return flattened(name, arrays) if rows > 1 else of.of_columns(name, arrays)


def _objects(name: str, key: str, array: np.ndarray) -> np.ndarray:
    """Numbers among None; anything else is refused."""
    try:
        return array.astype(float)
    except (TypeError, ValueError):
        raise RecordingError(name, f"{key} is not numeric (objects); give numbers") from None


def _of_frame(source: Any, name: str) -> Table:
    import pyarrow as pa

    try:
        if hasattr(source, "__arrow_c_stream__"):
            whole = pa.table(source)
        else:
            from pyarrow.interchange import from_dataframe

            whole = from_dataframe(source)
    except Exception as error:  # the library's own kind
        reason = " ".join(str(error).split())[:160]
        raise RecordingError(name, f"cannot be read as a table ({reason}); give columns of numbers") from None

    def batches(columns: list[str]) -> Iterable[Any]:
        return whole.select(columns).to_batches(max_chunksize=of.ROWS)

    first = next((batch for batch in whole.to_batches(max_chunksize=FIRST) if batch.num_rows), None)
    return arrow_table(name, whole.schema, first, batches)
