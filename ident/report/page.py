"""What a report consists of, as values: a page of sections, and in them plots, tables and text.

`fit_report` and `diagnosis_report` fill these from results; `render` turns them into HTML. Nothing here
computes, reads or writes.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Trace:
    """One curve of a panel. `role` picks the colour (and with it light or dark), see `page.js`."""

    name: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    role: str  # measured | model | error | before | after | floor | reference
    kind: str = "line"  # line | points | bars
    dash: str = "solid"


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes; the panels of a plot stand above each other and share their x axis."""

    y_label: str
    traces: tuple[Trace, ...]
    share: float = 1.0  # of the height, relative to the other panels
    log: bool = False


@dataclass(frozen=True, slots=True)
class Plot:
    """Panels over one x axis. Plots with the same `group` are zoomed together."""

    title: str
    x_label: str
    panels: tuple[Panel, ...]
    caption: str = ""
    group: str = ""
    same_scale: bool = False  # all panels have the y range of the first


@dataclass(frozen=True, slots=True)
class Column:
    """A table column; a number column sorts by value and is set flush right. `help` shows on hover."""

    title: str
    number: bool = False
    help: str = ""


@dataclass(frozen=True, slots=True)
class Cell:
    """Shown text, the value it is sorted by where that is not the text, and a tone."""

    text: str
    value: float | str | None = None
    tone: str = ""  # "" | good | bad | faint | wide


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells. A long table gets a box to filter its rows by text."""

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""

    def __post_init__(self) -> None:
        assert all(len(row) == len(self.columns) for row in self.rows), self.title


Block = Plot | Table


@dataclass(frozen=True, slots=True)
class Remark:
    """What was found in the data, in a sentence; `grave`: it was left as it is."""

    text: str
    grave: bool = True


@dataclass(frozen=True, slots=True)
class Fact:
    """A figure worth a large type: "9.4 %" over "error on the validate runs"."""

    value: str
    label: str
    tone: str = ""


@dataclass(frozen=True, slots=True)
class Section:
    """A heading, a sentence or two, then plots and tables in order. A folded one opens by a click."""

    title: str
    blocks: tuple[Block, ...]
    text: str = ""
    folded: bool = False


@dataclass(frozen=True, slots=True)
class ReportPage:
    """The whole page: what was found in the data, the verdict, warnings, facts, then sections."""

    title: str
    kind: str  # "Identification" | "Diagnosis"
    verdict: str
    tone: str  # good | bad | plain
    sections: tuple[Section, ...]
    facts: tuple[Fact, ...] = ()
    checks: tuple[Remark, ...] = ()
    warnings: tuple[str, ...] = ()
    details: tuple[str, ...] = field(default=())
    footer: str = ""
