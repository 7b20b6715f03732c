"""Where the decimated rows of long recordings wait: on disk, read back in pieces.

Ten hours of seven joints leave 360,000 rows of some 400 numbers at a cut-off of 4 Hz, more than everything
else together needs. They are appended to one unnamed file (in the system's folder for such, TMPDIR) as they
are made, and read as arrays are indexed, some entries of some rows at a time; the file goes with the last
value that reads from it.
"""

from __future__ import annotations

import tempfile
import threading
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

KIND = np.dtype(np.float32)


class Spool:
    """One unnamed file that rows are appended to; it is closed with the last value that reads from it."""

    def __init__(self) -> None:
        self.file = tempfile.TemporaryFile(prefix="ident-rows-")  # noqa: SIM115
        self.size, self.lock = 0, threading.Lock()
        weakref.finalize(self, self.file.close)

    def append(self, values: np.ndarray) -> SpilledRows:
        """values (E, m): m rows of E numbers each."""
        data = np.ascontiguousarray(values.T, KIND).tobytes()
        with self.lock:
            self.file.seek(self.size)
            self.file.write(data)
            out = SpilledRows(self, self.size, values.shape)
            self.size += len(data)
        return out

    def read(self, offset: int, count: int) -> bytes:
        with self.lock:
            self.file.seek(offset)
            return bytes(self.file.read(count))


@dataclass(frozen=True, slots=True)
class SpilledRows:
    """(E, m) numbers in a spool; `rows[entries]` and `rows[entries, start:stop]` read them."""

    spool: Spool
    offset: int
    shape: tuple[int, ...]
    dtype: np.dtype = KIND

    def __getitem__(self, key: Any) -> np.ndarray:
        entries, rows = key if isinstance(key, tuple) else (key, slice(None))
        start, stop, _ = rows.indices(self.shape[1])
        width = self.shape[0] * KIND.itemsize
        data = self.spool.read(self.offset + start * width, max(stop - start, 0) * width)
        return np.frombuffer(data, KIND).reshape(-1, self.shape[0]).T[entries]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self[:], dtype)

    def __reduce__(self) -> tuple[Any, ...]:  # another process has no such file
        return np.array, (self[:],)


def joined(parts: Sequence[Any]) -> Any:
    """Consecutive rows of one stretch as one value, in memory or in the spool as they are."""
    first = parts[0]
    if not isinstance(first, SpilledRows):
        return np.hstack(parts)
    return SpilledRows(first.spool, first.offset, (first.shape[0], sum(part.shape[1] for part in parts)))
