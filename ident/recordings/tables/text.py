"""Tables as text: comma, semicolon, tab or blank separated, with or without one header line."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ident.errors import RecordingError
from ident.recordings.tables import table as of
from ident.recordings.tables.arrow import numbers
from ident.recordings.tables.table import Blocks, Table


def text(path: Path, decimal: str) -> Table:
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
                yield np.column_stack([numbers(str(path), name, batch.column(name), {}) for name in columns])

    return Table(str(path), names, named, read)


def _blank_separated(path: Path, skip: int, indices: list[int]) -> Blocks:
    with path.open(encoding="utf-8-sig") as lines:
        rows = itertools.islice(lines, skip, None)
        while block := list(itertools.islice(rows, of.ROWS)):
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
