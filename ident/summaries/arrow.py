"""Arrow arrays from their buffers: pyarrow's own `array` imports pandas where it is installed, 0.3 s of a
worker's first recording and of a fleet's command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any

import numpy as np


def array(values: Sequence[Any], kind: Any) -> Any:
    """Numbers, texts or lists of such, or None, as an Arrow array of this kind."""
    import pyarrow as pa

    there = np.array([value is not None for value in values], bool)
    absent = None if there.all() else pa.py_buffer(np.packbits(there, bitorder="little"))

    def ends(parts: Sequence[Any]) -> Any:
        return pa.py_buffer(np.array([0, *accumulate(map(len, parts))], np.int32))

    if pa.types.is_list(kind):
        lists = [() if value is None else value for value in values]
        inner = array([item for its in lists for item in its], kind.value_type)
        return pa.Array.from_buffers(kind, len(lists), [absent, ends(lists)], children=[inner])
    if pa.types.is_string(kind):
        texts = [b"" if value is None else value.encode() for value in values]
        return pa.Array.from_buffers(kind, len(texts), [absent, ends(texts), pa.py_buffer(b"".join(texts))])
    numbers = np.array([0 if value is None else value for value in values], kind.to_pandas_dtype())
    return pa.Array.from_buffers(kind, len(numbers), [absent, pa.py_buffer(numbers)])


def table_of(columns: Mapping[str, np.ndarray]) -> Any:
    """An Arrow table of numbers, {name: (N,)}."""
    import pyarrow as pa

    def numbers(x: np.ndarray) -> Any:
        return pa.Array.from_buffers(pa.from_numpy_dtype(x.dtype), len(x), [None, pa.py_buffer(x)])

    return pa.table({name: numbers(np.ascontiguousarray(x)) for name, x in columns.items()})
