"""How a text table is written, decided from its beginning: encoding, separator, decimal sign, header, units.

Spreadsheets, controllers and scripts put titles, comments, blank lines and a row of units around their
numbers. The rows of numbers are found first, by the cells that most lines have; the names are what stands
above them. What could be read in two ways (a decimal comma between commas) is refused, never guessed.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ident.errors import RecordingError

NULLS: tuple[str, ...] = (
    "",
    "nan",
    "NaN",
    "NAN",
    "-nan",
    "NA",
    "N/A",
    "#N/A",
    "null",
    "NULL",
    "None",
    "none",
    "-",
    "--",
)
NULLS += ("nan(ind)", "-nan(ind)", "1.#QNAN", "-1.#IND", "1.#IND")
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d{1,9})?)?(Z|[+-]\d\d:?\d\d)?")
UNIT = re.compile(
    r"(1|-|%|m?s|[uµμn]s|sec|seconds|h|Hz|k?rad|deg(rees)?|°|counts?|m?m|cm|m?A|m?V|[km]?N"
    r"|[km]?N[ *·.]?m+|[km]?g"
    r"|W|°?C|degC|K|(rad|deg|°|m|mm|rpm|1|rev)/?(s|min|sec)?(\^?2|²|s)?|r/min)?"
)
LIST = re.compile(r"\[[-+\d.eEnaN,\s]*\d[-+\d.eEnaN,\s]*\]")
TWO_NUMBERS = re.compile(r"(^|\s)[-+]?\d+,\d+\s+[-+]?\d+(,\d+)?(\s|$)")
WITH_UNIT = re.compile(r".*?\s*[\[(]\s*([^\])]*?)\s*[\])]")
SAMPLE = 40  # lines of the body that are looked at


@dataclass(frozen=True, slots=True)
class Dialect:
    """Rows of `width` cells begin `offset` bytes into the file (in `encoding`)."""

    encoding: str
    separator: str
    decimal: str
    names: tuple[str, ...]
    has_names: bool
    units: Mapping[str, str]
    offset: int
    rows: tuple[tuple[str, ...], ...]  # the first ones, as text
    remarks: tuple[str, ...]

    @property
    def width(self) -> int:
        return len(self.names)


def dialect_of(file: str, head: bytes, whole: bool, decimal: str) -> Dialect:
    """From the first bytes of a file (`whole`: they are all of it). Raises RecordingError."""
    encoding, marked = _encoding(file, head)
    text = codecs.getincrementaldecoder(encoding)("replace").decode(head[marked:])
    lines = re.split("\r\n|\n|\r", text)
    if not whole:
        lines.pop()
    kept = [(number, line) for number, line in enumerate(lines) if line.strip()]
    if not kept:
        raise RecordingError(
            file, "holds no lines of numbers; export it again" if not whole else "is empty; record it again"
        )
    body = [line for _, line in kept[-SAMPLE:]]
    separator, width = _separator(body)
    start = next(
        (k for k, (_, line) in enumerate(kept) if _is_row(split(line, separator), width, separator)), None
    )
    if start is None:
        raise RecordingError(file, "holds no row of numbers below its header; record or export it again")
    rows = [split(line, separator) for _, line in kept[start : start + SAMPLE]]
    names, units, above = _header([line for _, line in kept[:start]], separator, width, rows)
    header = names if names else None
    decimal = _decimal(file, separator, decimal, header, rows)
    if header is not None and len(header) != width:
        raise RecordingError(
            file, f"the header has {len(header)} cells, the rows below it {width}; give every column one name"
        )
    remarks = []
    if above:
        remarks.append(f"{above} line{'s' if above > 1 else ''} above the header passed over")
    if units:
        remarks.append("the row of units was not taken for numbers")
    if decimal == ",":
        remarks.append("numbers are written with a decimal comma")
    first = kept[start][0]
    return Dialect(
        encoding,
        separator,
        decimal,
        _unique(file, names) if names else tuple(str(k) for k in range(width)),
        bool(names),
        _units(names, units),
        marked + _bytes_before(text, first, encoding),
        tuple(map(tuple, rows)),
        tuple(remarks),
    )


def split(line: str, separator: str) -> list[str]:
    """Cells of one line, stripped, quotes taken off."""
    if separator == " ":
        return line.split()
    try:
        cells = next(csv.reader([line.strip("\r\n \ufeff")], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:  # a quote that never ends
        cells = line.split(separator)
    return [cell.strip().strip('"').strip() for cell in cells]


def is_number(cell: str, decimal: str = ".") -> bool:
    """A finite or infinite number, or one of the ways to write that there is none."""
    if cell in NULLS:
        return True
    if "_" in cell or (decimal == "," and "." in cell):
        return False
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return True


def _encoding(file: str, head: bytes) -> tuple[str, int]:
    """Codec, and how many bytes its mark takes."""
    for mark, codec in (
        (codecs.BOM_UTF8, "utf-8"),
        (codecs.BOM_UTF16_LE, "utf-16-le"),
        (codecs.BOM_UTF16_BE, "utf-16-be"),
    ):
        if head.startswith(mark):
            return codec, len(mark)
    if b"\0" in head:
        raise RecordingError(file, "holds binary data, not text; export it as CSV or Parquet")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
        return "utf-8", 0
    except UnicodeDecodeError:
        return "latin-1", 0


def _bytes_before(text: str, line: int, encoding: str) -> int:
    position = 0
    for _ in range(line):
        found = re.compile("\r\n|\n|\r").search(text, position)
        assert found is not None
        position = found.end()
    return len(text[:position].encode(encoding))


def _separator(body: Sequence[str]) -> tuple[str, int]:
    """The first of tab, bar, semicolon, comma, blank that cuts most lines into as many cells of numbers."""
    for separator in "\t|;, ":
        widths = Counter(len(split(line, separator)) for line in body)
        width = max((w for w in widths if w > 1), key=lambda w: (widths[w], w), default=1)
        good = sum(_is_row(split(line, separator), width, separator) for line in body)
        if separator == "," and sum(TWO_NUMBERS.search(line) is not None for line in body) > good / 2:
            continue  # blanks separate numbers with a decimal comma
        if width > 1 and good and good >= 0.6 * len(body) - 3:
            return separator, width
    return ",", max((len(split(line, ",")) for line in body), default=1)


def _is_row(cells: Sequence[str], width: int, separator: str) -> bool:
    """As wide as the table, with numbers or dates in it, and not mostly words."""
    marks = "." if separator == "," else ".,"
    good = [
        any(is_number(c, m) for m in marks) or bool(DATE.fullmatch(c) or LIST.fullmatch(c)) for c in cells
    ]
    filled = sum(ok and cell not in NULLS for ok, cell in zip(good, cells))
    return len(cells) == width and filled > 0 and 2 * sum(good) >= width


def _header(
    above: list[str], separator: str, width: int, rows: Sequence[Sequence[str]]
) -> tuple[list[str], list[str], int]:
    """Names, units, and how many lines stand above them. No names: []."""
    cells = [_named(line, separator, width) for line in above]
    if not cells:
        return [], [], 0
    names, units, lines = cells[-1], [], 1
    if (
        len(cells) > 1
        and len(cells[-2]) == len(names) == width
        and all(UNIT.fullmatch(_bare(c)) for c in names)
    ):
        names, units, lines = cells[-2], names, 2
    if len(names) == width - 1 and all(len(row) == width and not row[-1] for row in rows):
        names = [*names, ""]  # every row ends with a separator
    if len(names) != width and (len(names) == 1 or above[-1].lstrip()[:1] in "#%!/"):
        return [], [], len(above)  # a title or a comment
    return names, units, len(above) - lines


def _named(line: str, separator: str, width: int) -> list[str]:
    """Cells of a line above the numbers; as in `# t, q1` above blank-separated numbers if that fits."""
    plain = re.sub(r"^\s*(#|%|//|!)+\s*", "", line)
    cuts = [split(line, separator), *(split(plain, mark) for mark in (separator, ",", ";", "|", "\t", " "))]
    fitting = [cells for cells in cuts if len(cells) == width]
    if plain != line:
        fitting = [cells for cells in cuts[1:] if len(cells) == width]
    return fitting[0] if fitting else cuts[0]


def _bare(cell: str) -> str:
    return cell.strip("[]() ")


def _units(names: Sequence[str], units: Sequence[str]) -> dict[str, str]:
    """From a row of units, or from names such as `q1 [deg]`."""
    if units:
        return {name: _bare(unit) for name, unit in zip(names, units) if _bare(unit)}
    found = {name: WITH_UNIT.fullmatch(name) for name in names}
    return {name: match[1] for name, match in found.items() if match}


def _unique(file: str, names: Sequence[str]) -> tuple[str, ...]:
    named = [name or str(k) for k, name in enumerate(names)]
    twice = next((name for name in named if named.count(name) > 1), None)
    if twice is not None:
        raise RecordingError(file, f"two columns are called {twice}; rename one")
    return tuple(named)


def _decimal(
    file: str, separator: str, decimal: str, header: Sequence[str] | None, rows: Sequence[Sequence[str]]
) -> str:
    """A comma that stands for the decimal point must not be taken for a separator, nor for text."""
    remedy = (
        "write decimal points, or separate by semicolons and say decimal: ',' beside the file in the study"
    )
    if separator == ",":
        if header is not None and len(rows[0]) > 1.4 * len(header):
            raise RecordingError(
                file,
                "the rows have more cells than the header, as when numbers are written with a decimal "
                f"comma; {remedy}",
            )
        return decimal
    cells = [cell for row in rows for cell in row]
    commas = [cell for cell in cells if "," in cell and is_number(cell, ",")]
    if decimal == "," or not commas:
        return decimal
    points = any("." in cell and is_number(cell) for cell in cells)
    if points or all(re.fullmatch(r"[-+]?[1-9]\d{0,2}(,\d{3})+", cell) for cell in commas):
        raise RecordingError(
            file, f"{commas[0]} may be a number with a decimal comma or with thousands marked; {remedy}"
        )
    return ","
