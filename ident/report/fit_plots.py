"""The paper's figures: torques with their error (4 to 7), histogram of normalised errors (3). Only drawing.

Every function takes results and an axes (matplotlib's or that of svg.py) and returns what it drew.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ident.equations.comparison import Curves
from ident.estimation.fit import FitResult
from ident.report.svg import Axes, figure

POINTS = 1500  # of a drawn line


def torque(curves: Curves, channel: int, ax: Any) -> list[Any]:
    """Measured (red), reconstructed (blue) torque and their difference (black) of one channel."""
    step = max(1, len(curves.t) // POINTS)
    t, measured, modelled = (
        curves.t[::step],
        curves.measured[::step, channel],
        curves.modelled[::step, channel],
    )
    lines = ax.plot(t, measured, "r", lw=0.8, label="measured")
    lines += ax.plot(t, modelled, "b", lw=0.8, label="reconstructed")
    lines += ax.plot(t, measured - modelled, "k", lw=0.6, label="error")
    ax.margins(x=0)
    return lines


def histogram(normalised: np.ndarray, ax: Any) -> list[Any]:
    """Density of rho / sigma_j (rows,) with the Gaussian N(0, 1) that weighting assumes."""
    values = np.ravel(normalised)
    density, edges = np.histogram(values[np.abs(values) < 5], bins=60, density=True)
    bars = ax.stairs(density, edges, fill=True, color="0.7")
    x = np.linspace(-5, 5, 200)
    line = ax.plot(x, np.exp(-(x**2) / 2) / math.sqrt(2 * math.pi), "k", lw=1.2, label="N(0, 1)")
    ax.set_xlabel("error / standard deviation")
    ax.set_ylabel("density")
    return [bars, *line]


def draw_all(result: FitResult, folder: Path) -> None:
    """torque_<recording>.svg for each recording, histogram.svg; the same drawing gives the same file."""
    folder.mkdir(parents=True, exist_ok=True)
    channels = result.columns.channels
    for curves in result.errors.curves:
        if len(curves.t):
            drawn = figure(_torques(curves, channels), 800, 110)
            (folder / f"torque_{_safe(curves.label)}.svg").write_text(drawn, encoding="utf-8")
    ax = Axes()
    histogram(result.normalised, ax)
    (folder / "histogram.svg").write_text(figure([[ax]], 500, 300), encoding="utf-8")


def _torques(curves: Curves, channels: Sequence[str]) -> list[list[Axes]]:
    """One axes a channel, in two columns where there are more than seven."""
    axes = [Axes() for _ in channels]
    for k, (name, ax) in enumerate(zip(channels, axes)):
        torque(curves, k, ax)
        ax.set_ylabel(name)
    rows = -(-len(channels) // (2 if len(channels) > 7 else 1))
    columns = [axes[k : k + rows] for k in range(0, len(axes), rows)]
    for column in columns:
        column[-1].set_xlabel("t [s]")
    axes[0].legend(title=f"{curves.label} ({curves.role})")
    return columns


def _safe(label: str) -> str:
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in label)
