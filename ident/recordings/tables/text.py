"""Tables as text, in the dialects of `dialect.py`, read in blocks whatever their length.

A last line that was cut off while it was written is left out and said. Dates and times of day become seconds
since the first row; cells such as `[0.1, 0.2]` are spread over name1..namen.
"""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ident.errors import RecordingError
from ident.recordings.tables.arrow import numbers
from ident.recordings.tables.dialect import DATE, LIST, NULLS, Dialect, dialect_of, is_number, split
from ident.recordings.tables.table import Blocks, Table, damaged, not_numeric
from ident.recordings.tables.times_of_day import TIME, Times

HEAD = 1 << 18  # bytes that tell the dialect
BLOCK = 1 << 21
REFUSED = re.compile(
    r"In CSV column #(\d+): (?:Row #(\d+): )?CSV conversion error to [^:]*: invalid value (.*)"
)


def text(path: Path, decimal: str = ".") -> Table:
    """A table whose rows are lines. Raises RecordingError for what is none."""
    size = path.stat().st_size
    with path.open("rb") as opened:
        head = opened.read(HEAD)
    dialect = dialect_of(str(path), head, len(head) == size, decimal)
    end, cut = _end(path, size, dialect)
    if end <= dialect.offset:
        raise RecordingError(str(path), "holds no whole row of numbers below its header; record it again")
    places: dict[str, tuple[int, int | None]] = {}  # column -> column of the file, index in its list
    for k, name in enumerate(dialect.names):
        cells = [row[k] for row in dialect.rows if k < len(row) and row[k] not in NULLS]
        if cells and all(LIST.fullmatch(cell) for cell in cells):
            places |= {f"{name}{j + 1}": (k, j) for j in range(len(_list(cells[0])))}
        else:
            places[name] = (k, None)

    def read(columns: Sequence[str]) -> Blocks:
        return _read(path, dialect, end, [places[name] for name in columns])

    return Table(str(path), tuple(places), dialect.has_names, read, dialect.units, dialect.remarks, cut)


def _end(path: Path, size: int, dialect: Dialect) -> tuple[int, str]:
    """Where the last whole line ends, and a sentence if what follows was cut off."""
    with path.open("rb") as opened:
        opened.seek(max(dialect.offset, size - HEAD))
        tail = opened.read()
    newline = "\n".encode(dialect.encoding)
    if not tail.strip() or tail.endswith((newline, b"\r")):
        last = tail.rstrip(b"\r\n\0 \t") if dialect.separator != "\t" else tail.rstrip(b"\r\n\0 ")
    else:
        last = tail
    start = last.rfind(newline) + len(newline) if newline in last else 0
    *above, cells = (
        split(line.decode(dialect.encoding, "replace"), dialect.separator)
        for line in (*last[:start].split(newline)[-20:], last[start:])
    )
    before = size - len(tail) + start
    width = dialect.width
    broken = len(cells) < width or (not _whole(cells, above) and not tail.endswith((newline, b"\r")))
    if last[start:].strip() and broken and len(cells) <= width:
        return before, f"the last line is cut off ({len(cells)} of {width} cells) and left out"
    return size, ""


def _whole(cells: Sequence[str], above: Sequence[Sequence[str]]) -> bool:
    """Whether a last line that is not ended has a last cell as long as those above it."""
    lengths = [len(row[-1]) for row in above if len(row) == len(cells)]
    return len(cells[-1]) >= min(lengths, default=0)


class _Rows(io.RawIOBase):
    """The bytes of the rows alone, as UTF-8 where they are UTF-16, runs of blanks made tabs where those
    separate."""

    def __init__(self, opened: Any, left: int, dialect: Dialect) -> None:
        self.opened, self.left = opened, left
        self.blanks = dialect.separator == " "
        wide = dialect.encoding.startswith("utf-16")
        self.decoder = codecs.getincrementaldecoder(dialect.encoding)("replace") if wide else None
        self.ready = self.unfinished = b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while not self.ready and self.left:
            chunk = self.opened.read(min(self.left, BLOCK))
            self.left = self.left - len(chunk) if chunk else 0
            if self.decoder is not None:
                chunk = self.decoder.decode(chunk).encode()
            self.ready = self._tabs(chunk) if self.blanks else chunk
        count = min(len(buffer), len(self.ready))
        buffer[:count], self.ready = self.ready[:count], self.ready[count:]
        return count

    def _tabs(self, chunk: bytes) -> bytes:
        chunk = self.unfinished + chunk
        end = max(chunk.rfind(b"\n"), chunk.rfind(b"\r")) + 1 if self.left else len(chunk)
        self.unfinished = chunk[end:]
        lines = (b"\t".join(line.split()) for line in chunk[:end].splitlines())
        return b"".join(line + b"\n" for line in lines if line)


def _read(path: Path, dialect: Dialect, end: int, places: Sequence[tuple[int, int | None]]) -> Blocks:
    import pyarrow as pa
    import pyarrow.csv as pc

    used = sorted({k for k, _ in places})
    types, names = {}, [str(k) for k in range(dialect.width)]
    for k in used:
        cells = [row[k] for row in dialect.rows if k < len(row) and row[k] not in NULLS]
        types[str(k)] = pa.string() if any(j is not None for i, j in places if i == k) else _type(cells)
    convert = pc.ConvertOptions(
        column_types=types,
        decimal_point=dialect.decimal,
        include_columns=[str(k) for k in used],
        null_values=list(NULLS),
        strings_can_be_null=True,
    )
    parse = pc.ParseOptions(delimiter="\t" if dialect.separator == " " else dialect.separator)
    # One thread: with several, Arrow does not say in which row a cell is no number.
    options = pc.ReadOptions(column_names=names, block_size=BLOCK, use_threads=False)
    lists = {k for k, j in places if j is not None}
    texts = [k for k in used if k not in lists and types[str(k)] == pa.string()]
    origins: dict[str, Any] = {dialect.names[k]: Times() for k in texts}
    with path.open("rb") as opened:
        opened.seek(dialect.offset)
        rows = io.BufferedReader(_Rows(opened, end - dialect.offset, dialect), BLOCK)
        try:
            for batch in pc.open_csv(pa.PythonFile(rows, mode="r"), options, parse, convert):
                values = {k: _column(path, dialect.names[k], batch.column(str(k)), origins) for k in used}
                yield np.column_stack([values[k] if j is None else values[k][:, j] for k, j in places])
        except pa.ArrowInvalid as error:
            raise _refused(path, dialect, error) from None


def _type(cells: Sequence[str]) -> Any:
    import pyarrow as pa

    if cells and all(DATE.fullmatch(cell) for cell in cells) and not any(is_number(cell) for cell in cells):
        zone = re.search(r"(Z|[+-]\d\d:?\d\d)$", cells[0][10:]) is not None
        return pa.timestamp("ns", tz="UTC" if zone else None)
    if cells and all(TIME.fullmatch(cell) for cell in cells):
        return pa.string()
    return pa.float64()


def _column(path: Path, name: str, column: Any, origins: dict[str, Any]) -> np.ndarray:
    import pyarrow.types as types

    if not types.is_string(column.type):
        return numbers(str(path), name, column, origins)
    if name in origins:
        try:
            return np.asarray(origins[name].seconds(column.to_pylist()))
        except ValueError as error:
            raise not_numeric(str(path), name, str(error)[:40]) from None
    cells = [_list(cell) if cell else None for cell in column.to_pylist()]
    width = max((len(cell) for cell in cells if cell is not None), default=0)
    if any(cell is not None and len(cell) != width for cell in cells):
        raise RecordingError(
            str(path),
            f"column {name} holds lists of different lengths; export one number a joint",
        )
    return np.array([[np.nan] * width if cell is None else cell for cell in cells], float)


def _list(cell: str) -> list[float]:
    return [float(part) for part in cell.strip("[] ").replace(",", " ").split()]


def _refused(path: Path, dialect: Dialect, error: Exception) -> RecordingError:
    found = REFUSED.match(" ".join(str(error).split()))
    if not found:
        return damaged(str(path), error)
    where = f", row {found[2]}" if found[2] else ""
    return not_numeric(str(path), dialect.names[int(found[1])], f"{found[3][:40]}{where}")
