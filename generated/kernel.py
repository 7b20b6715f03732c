"""A compiled model behind ctypes: entries of a block, W whole, torques. Every call releases the GIL.

The kernel notices samples that are not finite while it has them in registers, which costs next to nothing;
they are then looked for and refused.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from generated.errors import GeneratedError

Array = np.ndarray
LANES = 8  # the widest build's; buffers have room for a last group of this size


class _Table(ctypes.Structure):
    _fields_ = (("data", ctypes.c_void_p), ("row", ctypes.c_ssize_t), ("column", ctypes.c_ssize_t))

    @classmethod
    def of(cls, array: Array | None) -> _Table:
        """Strides in doubles; None is an absent table."""
        if array is None or array.shape[1] == 0:
            return cls(None, 0, 0)
        return cls(array.ctypes.data, array.strides[0] // 8, array.strides[1] // 8)


class _Samples(ctypes.Structure):
    _fields_ = tuple((name, _Table) for name in ("q", "dq", "ddq", "sign", "extra"))


class _Stream(ctypes.Structure):
    _fields_ = (
        ("samples", ctypes.c_void_p),
        *((name, ctypes.c_ssize_t) for name in ("next", "last", "block")),
        ("row", ctypes.c_void_p),
        ("copies", ctypes.c_ssize_t),
        ("copy_of", ctypes.c_void_p),
        ("copy_row", ctypes.c_void_p),
    )


class Samples:
    """q, dq, ddq (N, n), sign (N, n) or None for sign(dq), extra (N, e): float64, any strides, kept alive."""

    def __init__(self, q: Array, dq: Array, ddq: Array, sign: Array | None, extra: Array) -> None:
        self.arrays = (q, dq, ddq, sign, extra)
        self.rows = len(q)
        self.tables = _Samples(*(_Table.of(array) for array in self.arrays))
        self.pointer = ctypes.addressof(self.tables)

    def refuse(self, first: int = 0, last: int | None = None) -> None:
        """Raise GeneratedError for the first number that is not finite, if there is one."""
        for name, array in zip(("q", "dq", "ddq", "sign", "extra"), self.arrays):
            if array is None or np.isfinite(array[first:last]).all():
                continue
            row, column = np.argwhere(~np.isfinite(array[first:last]))[0]
            raise GeneratedError(
                f"{name} holds {array[first + row, column]} in row {first + row}, column {column} (from 0); "
                "leave out what is not finite."
            )


@dataclass(frozen=True, slots=True)
class Placement:
    """Rows of a buffer: entry k goes to rows[k], then source copy_of[k] to copy_rows[k]; `ones` hold 1."""

    rows: Array  # int64
    copy_of: Array  # int32
    copy_rows: Array  # int64
    ones: Array


class Kernel:
    """The functions of one compiled model. `rows` are half-open ranges of samples."""

    def __init__(self, library: Path, entries: int) -> None:
        self.entries = entries
        lib = self._library = ctypes.CDLL(str(library))
        size, pointer = ctypes.c_ssize_t, ctypes.c_void_p
        self._block, self._dense, self._torque = lib.dynident_block, lib.dynident_dense, lib.dynident_torque
        self._block.argtypes = [pointer]
        self._dense.argtypes = [
            pointer,
            size,
            size,
            pointer,
            size,
            size,
            pointer,
            pointer,
            pointer,
            ctypes.c_int,
        ]
        self._torque.argtypes = [pointer, size, size, pointer, pointer]
        for function in (self._block, self._dense, self._torque):
            function.restype = ctypes.c_int  # 1 if all samples are finite

    def stream(self, samples: Samples, buffer: Array, place: Placement, width: int) -> Callable[[], int]:
        """Writes the next `width` samples' entries into `buffer` (rows, width or more) at every call; 0 where
        they are not all finite."""
        start, row = buffer.ctypes.data, buffer.strides[0]
        rows, copy_rows = start + place.rows * row, start + place.copy_rows * row
        stream = _Stream(
            samples.pointer, 0, samples.rows, width, rows.ctypes.data, len(place.copy_of),
            place.copy_of.ctypes.data, copy_rows.ctypes.data,
        )  # fmt: skip
        stream.kept = (samples, buffer, place, rows, copy_rows)
        return partial(self._block, ctypes.byref(stream))

    def dense(
        self,
        samples: Samples,
        first: int,
        last: int,
        W: Array,
        source: Array,
        target: Array,
        past_caches: bool,
    ) -> None:
        """W (N, width) row after row: non-zero k of a sample is source[k] and stands at target[k] (int32)."""
        width = W[0].size
        zeros = np.zeros(width)
        if not self._dense(
            samples.pointer, first, last, W.ctypes.data, width, len(source), source.ctypes.data,
            target.ctypes.data, zeros.ctypes.data, past_caches,
        ):  # fmt: skip
            samples.refuse(first, last)

    def torque(self, samples: Samples, first: int, last: int, chi: Array, tau: Array) -> None:
        """tau (N, channels)."""
        if not self._torque(samples.pointer, first, last, chi.ctypes.data, tau.ctypes.data):
            samples.refuse(first, last)

    def cos_sin(self, x: Array) -> tuple[Array, Array]:
        """cos and sin as the kernel takes them, of a multiple of LANES numbers; for tests."""
        c, s = np.empty_like(x), np.empty_like(x)
        function = self._library.dynident_cos_sin
        function.argtypes, function.restype = [ctypes.c_void_p] * 3 + [ctypes.c_ssize_t], None
        function(x.ctypes.data, c.ctypes.data, s.ctypes.data, len(x))
        return c, s
