"""Numeric arrays of a MAT file (version 4 to 7), read with every length checked before it is used.

A damaged file ends in a sentence; the usual reader, being C that trusts lengths, ends the process instead.
Layout: MathWorks, "MAT-File Format", levels 4 and 5. The fields of a structure are arrays of their own, named
by their paths ("log.q"); arrays of structures, cells, text and complex arrays are passed over.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator

import numpy as np

LARGEST = 1 << 31  # bytes of one array
COMPRESSED, MATRIX = 15, 14
TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
STRUCTURE = 2
NUMERIC = range(6, 16)  # classes double, single, int8 .. uint64
COMPLEX, LOGICAL = 0x800, 0x200
TYPES_4 = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}
FULL, SPARSE = 0, 2  # of version 4; 1 is text


def numeric_arrays(data: bytes) -> dict[str, np.ndarray]:
    """{name: array}. Raises ValueError for what is no such file, or a damaged one."""
    marks = {b"IM": "<", b"MI": ">"}
    if 0 in data[:4]:  # the text that level 5 begins with has no zero there
        return _level_4(data)
    if len(data) < 128 or data[126:128] not in marks:
        raise ValueError("not a MAT file; save it with -v7")
    order = marks[data[126:128]]
    found: dict[str, np.ndarray] = {}
    position = 128
    while position < len(data):
        kind, size = struct.unpack_from(order + "II", _part(data, position, 8))
        body = _part(data, position + 8, size)
        position += 8 + size
        if kind == COMPRESSED:
            body = zlib.decompressobj().decompress(body, LARGEST)
            kind, size = struct.unpack_from(order + "II", _part(body, 0, 8))
            body = _part(body, 8, size)
        if kind == MATRIX:
            found |= _matrix(body, order)
    return found


def _level_4(data: bytes) -> dict[str, np.ndarray]:
    """Version 4: per array type, rows, columns, imaginary, length of the name; the name; the numbers."""
    found: dict[str, np.ndarray] = {}
    order = "<" if struct.unpack_from("<i", _part(data, 0, 4))[0] < 5000 else ">"
    position = 0
    while position < len(data):
        kind, rows, columns, imaginary, length = struct.unpack(order + "5i", _part(data, position, 20))
        machine, zero, number, form = kind // 1000, kind // 100 % 10, kind // 10 % 10, kind % 10
        if machine not in (0, 1) or zero or number not in TYPES_4 or form > 2 or min(rows, columns) < 0:
            raise ValueError("not a MAT file of version 4 in IEEE numbers; save it with -v7")
        dtype = np.dtype(order + TYPES_4[number])
        name = _part(data, position + 20, length).rstrip(b"\0").decode("ascii", "replace")
        position += 20 + length
        size = rows * columns * dtype.itemsize
        if form == FULL and imaginary == 0:
            values = np.frombuffer(_part(data, position, size), dtype)
            found[name] = values.reshape((rows, columns), order="F").astype(float)
        position += size * (2 if imaginary and form != SPARSE else 1)
    return found


def _part(data: bytes, start: int, size: int) -> bytes:
    if size < 0 or start + size > len(data):
        raise ValueError("it ends inside an array")
    return data[start : start + size]


def _elements(body: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """(type, data) of the parts of an array; short ones share a word with their tag."""
    position = 0
    while position < len(body):
        (word,) = struct.unpack(order + "I", _part(body, position, 4))
        if word >> 16:
            yield word & 0xFFFF, _part(body, position + 4, min(word >> 16, 4))
            position += 8
        else:
            (size,) = struct.unpack(order + "I", _part(body, position + 4, 4))
            yield word, _part(body, position + 8, size)
            position += 8 + -(-size // 8) * 8


def _matrix(body: bytes, order: str) -> dict[str, np.ndarray]:
    parts = _elements(body, order)
    try:
        (_, flags), (_, shape), (_, name), (kind, real) = (next(parts) for _ in range(4))
    except (StopIteration, RuntimeError):
        return {}  # empty, or of a class without numbers
    (word,) = struct.unpack(order + "I", _part(flags, 0, 4))
    if word & 0xFF == STRUCTURE and shape == struct.pack(order + "2i", 1, 1):
        return _fields(name.decode("ascii", "replace"), real, parts, order)
    if word & 0xFF not in NUMERIC or word & COMPLEX or kind not in TYPES:
        return {}
    dimensions = struct.unpack(f"{order}{len(shape) // 4}i", _part(shape, 0, len(shape) // 4 * 4))
    dtype = np.dtype(order + TYPES[kind])
    if min(dimensions, default=-1) < 0 or math.prod(dimensions) * dtype.itemsize != len(real):
        raise ValueError("an array's size does not fit its shape")
    values = np.frombuffer(real, dtype).reshape(dimensions, order="F")
    return {name.decode("ascii", "replace"): values.astype(bool) if word & LOGICAL else values.astype(float)}


def _fields(
    name: str, length: bytes, parts: Iterator[tuple[int, bytes]], order: str
) -> dict[str, np.ndarray]:
    """Of one structure: the length of a field's name, all names, the fields' arrays, which have no names."""
    (size,) = struct.unpack(order + "i", _part(length, 0, 4))
    _, text = next(parts, (0, b""))
    names = [text[k : k + size].rstrip(b"\0").decode("ascii", "replace") for k in range(0, len(text), size)]
    found: dict[str, np.ndarray] = {}
    for field, (kind, body) in zip(names, parts):
        if kind == MATRIX:
            inside = _matrix(body, order)
            found |= {f"{name}.{field}{path and '.' + path.lstrip('.')}": x for path, x in inside.items()}
    return found
