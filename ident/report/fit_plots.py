"""The paper's figures: torques with their error (4 to 7), histogram of normalised errors (3). Only drawing.

Every function takes results and an axes and returns the artists. `draw_all` writes SVG files without
pyplot, so no display and no global state are involved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ident.equations.comparison import Curves
from ident.estimation.fit import FitResult

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
    _counts, _edges, bars = ax.hist(values[np.abs(values) < 5], bins=60, density=True, color="0.7")
    x = np.linspace(-5, 5, 200)
    line = ax.plot(x, np.exp(-(x**2) / 2) / math.sqrt(2 * math.pi), "k", lw=1.2, label="N(0, 1)")
    ax.set_xlabel("error / standard deviation")
    ax.set_ylabel("density")
    return [*bars, *line]


def draw_all(result: FitResult, folder: Path) -> None:
    """torque_<recording>.svg for each recording, histogram.svg; the same drawing gives the same file."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    def drawn(name: str, size: tuple[float, float], draw: Callable[[Any], object]) -> None:
        with matplotlib.rc_context({"svg.hashsalt": "dynident"}):
            figure = Figure(figsize=size)
            FigureCanvasSVG(figure)
            draw(figure)
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})

    folder.mkdir(parents=True, exist_ok=True)
    channels = result.columns.channels
    columns = 2 if len(channels) > 7 else 1
    rows = -(-len(channels) // columns)
    for curves in result.errors.curves:
        if len(curves.t):
            torques = partial(_torques, curves=curves, channels=channels, rows=rows, columns=columns)
            drawn(f"torque_{_safe(curves.label)}", (9 * columns, 1.7 * rows), torques)
    drawn("histogram", (6, 4), lambda figure: histogram(result.normalised, figure.add_subplot()))


def _torques(figure: Any, curves: Curves, channels: Sequence[str], rows: int, columns: int) -> None:
    from matplotlib.ticker import MaxNLocator, NullLocator

    figure.subplots_adjust(
        left=0.08 / columns + 0.02, right=0.99, top=0.97, bottom=0.05, hspace=0.15, wspace=0.12
    )
    for k, name in enumerate(channels):
        ax = figure.add_subplot(rows, columns, k % rows * columns + k // rows + 1)
        torque(curves, k, ax)
        ax.set_ylabel(name)
        ax.yaxis.set_major_locator(MaxNLocator(2))
        if k % rows == rows - 1 or k == len(channels) - 1:
            ax.set_xlabel("t [s]")
        else:
            ax.xaxis.set_major_locator(NullLocator())  # ticks are what takes the time
        if k == 0:
            ax.legend(loc="upper right", fontsize="small", ncols=3, title=f"{curves.label} ({curves.role})")


def _safe(label: str) -> str:
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in label)
