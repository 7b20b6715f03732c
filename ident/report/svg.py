"""Charts as SVG text through the little of matplotlib's `Axes` that they need: what draws takes an axes and
cannot tell which it was given. matplotlib takes longer to import and to save than 90 s of a robot to fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

COLOURS = {"r": "red", "b": "blue", "k": "black", "0.7": "#b3b3b3"}
FINE = 10  # units of a coordinate in a pixel
LEFT, RIGHT, TOP, BOTTOM = 64, 10, 8, 12  # px around the plots
GAP, LABEL = 12, 34  # px between rows; below one that is labelled


@dataclass(frozen=True, slots=True)
class Shape:
    """A line, or an area down to zero, through x, y (N,); NaN breaks it."""

    x: np.ndarray
    y: np.ndarray
    color: str
    lw: float
    label: str = ""
    area: bool = False


@dataclass(slots=True)
class Axes:
    """One pair of axes; the methods are matplotlib's, with what of their arguments is used."""

    shapes: list[Shape] = field(default_factory=list)
    labels: list[str] = field(default_factory=lambda: ["", ""])
    margin: float = 0.05  # of the range of x, either side
    told: str | None = None  # title of the legend, None: no legend

    def plot(self, x: Any, y: Any, color: str = "k", *, lw: float = 1.0, label: str = "") -> list[Shape]:
        self.shapes.append(Shape(np.asarray(x, float), np.asarray(y, float), color, lw, label))
        return self.shapes[-1:]

    def stairs(self, values: Any, edges: Any, *, fill: bool, color: str) -> Shape:
        x, y = np.repeat(edges, 2), np.concatenate([[0.0], np.repeat(values, 2), [0.0]])
        self.shapes.append(Shape(x, y, color, 0.0, area=fill))
        return self.shapes[-1]

    def margins(self, x: float) -> None:
        self.margin = x

    def set_xlabel(self, text: str) -> None:
        self.labels[0] = text

    def set_ylabel(self, text: str) -> None:
        self.labels[1] = text

    def legend(self, title: str = "") -> None:
        self.told = title


def figure(axes: list[list[Axes]], width: float, height: float) -> str:
    """An SVG of columns of axes, `width` by `height` pixels each; ticks of x only where there is a label."""
    columns, below = [], 0.0
    for number, column in enumerate(axes):
        top = float(TOP)
        for ax in column:
            x = number * (LEFT + width + RIGHT) + LEFT
            columns.append(f'<g transform="translate({x:g} {top:g})">{_drawn(ax, width, height)}</g>')
            top += height + (LABEL if ax.labels[0] else GAP)
        below = max(below, top)
    size = (len(axes) * (LEFT + width + RIGHT), below + BOTTOM)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]:g}" height="{size[1]:g}" '
        f'viewBox="0 0 {size[0]:g} {size[1]:g}" font-family="sans-serif" font-size="11">'
        f'<rect width="100%" height="100%" fill="white"/>{"".join(columns)}</svg>\n'
    )


def _drawn(ax: Axes, width: float, height: float) -> str:
    (left, right), (low, high) = _range(ax, 0, ax.margin), _range(ax, 1, 0.05)
    across, up = width / (right - left), height / (high - low)
    parts = [f'<g transform="scale({1 / FINE:g})" fill="none" stroke-linejoin="round">']
    for shape in ax.shapes:
        path = _path((shape.x - left) * across * FINE, (high - shape.y) * up * FINE)
        colour = COLOURS[shape.color]
        ink = f'fill="{colour}"' if shape.area else f'stroke="{colour}" stroke-width="{shape.lw * FINE:g}"'
        parts.append(f'<path d="{path}" {ink}/>')
    parts.append(f'</g><rect width="{width:g}" height="{height:g}" fill="none" stroke="black"/>')
    for value in ticks(low, high, 5):
        y = (high - value) * up
        parts.append(f'<path d="M-4 {y:.1f}H0" stroke="black"/>')
        parts.append(f'<text x="-6" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    for value in ticks(left, right, 8) if ax.labels[0] else ():
        x = (value - left) * across
        parts.append(f'<path d="M{x:.1f} {height:g}v4" stroke="black"/>')
        parts.append(f'<text x="{x:.1f}" y="{height + 15:g}" text-anchor="middle">{value:g}</text>')
    parts += [
        f'<text x="{width / 2:g}" y="{height + 29:g}" text-anchor="middle">{escape(ax.labels[0])}</text>',
        f'<text transform="translate(-46 {height / 2:g}) rotate(-90)" text-anchor="middle">'
        f"{escape(ax.labels[1])}</text>",
    ]
    if ax.told is not None:
        names = [(shape.label, COLOURS[shape.color]) for shape in ax.shapes if shape.label]
        keys = "".join(f'<tspan fill="{colour}">&#8212; {escape(name)}  </tspan>' for name, colour in names)
        parts.append(
            f'<text x="{width - 6:g}" y="13" text-anchor="end" xml:space="preserve" paint-order="stroke" '
            f'stroke="white" stroke-width="3">{escape(ax.told)}  {keys}</text>'
        )
    return "".join(parts)


def _range(ax: Axes, axis: int, margin: float) -> tuple[float, float]:
    values = [shape.y if axis else shape.x for shape in ax.shapes]
    finite = [value[np.isfinite(value)] for value in values if np.isfinite(value).any()]
    low = min((float(value.min()) for value in finite), default=0.0)
    high = max((float(value.max()) for value in finite), default=1.0)
    by = margin * (high - low) if high > low else 0.5 * abs(high) or 0.5
    return low - by, high + by


def _path(x: np.ndarray, y: np.ndarray) -> str:
    """`M` before the first point and after every gap, points in whole units."""
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    points = np.rint(np.stack([x[known], y[known]], axis=1)).astype(int)
    runs = np.split(points, np.flatnonzero(np.diff(known) > 1) + 1)
    return "".join("M" + " ".join(map(str, run.ravel().tolist())) for run in runs if len(run))


def ticks(low: float, high: float, most: int) -> Iterable[float]:
    """At most `most` or so round numbers in low..high: 1, 2 or 5 times a power of ten apart."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough)
    return [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]
