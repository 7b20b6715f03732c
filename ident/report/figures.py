"""A `Plot` as the JSON that plotly.js draws. Colours are left to the page, which knows light from dark."""

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ident.report.page import Panel, Plot, Trace

PANEL_HEIGHT, MARGIN_HEIGHT, GAP = 170, 96, 0.06


def packed(values: NDArray[np.float64]) -> dict[str, str]:
    """Plotly's typed array: little-endian float32 in base64 (a sixth of the decimals' size)."""
    data = np.asarray(values, dtype="<f4").tobytes()
    return {"dtype": "f4", "bdata": base64.b64encode(data).decode("ascii")}


def figure(plot: Plot) -> dict[str, Any]:
    """`{"data": [...], "layout": {...}}` with one y axis per panel and one shared x axis at the bottom."""
    shares = np.array([panel.share for panel in plot.panels])
    gap = GAP if len(shares) > 1 else 0.0
    heights = shares / shares.sum() * (1 - gap * (len(shares) - 1))
    layout: dict[str, Any] = {
        "height": round(PANEL_HEIGHT * float(shares.sum()) + MARGIN_HEIGHT),
        "xaxis": {"title": {"text": plot.x_label}, "anchor": "y" if len(shares) == 1 else f"y{len(shares)}"},
    }
    data = []
    top = 1.0
    seen: set[str] = set()
    for number, (panel, height) in enumerate(zip(plot.panels, heights, strict=True), start=1):
        axis = "" if number == 1 else str(number)
        layout[f"yaxis{axis}"] = _y_axis(panel, top - float(height), top)
        if plot.same_scale and number > 1:
            layout[f"yaxis{axis}"]["matches"] = "y"
        top -= float(height) + gap
        for trace in panel.traces:
            data.append(_trace(trace, f"y{axis}", legend=trace.name not in seen))
            seen.add(trace.name)
    return {"data": data, "layout": layout, "group": plot.group}


def _y_axis(panel: Panel, bottom: float, top: float) -> dict[str, Any]:
    axis: dict[str, Any] = {
        "title": {"text": panel.y_label},
        "domain": [round(max(bottom, 0.0), 4), round(top, 4)],
    }
    if panel.log:
        axis["type"] = "log"
    return axis


def _trace(trace: Trace, y_axis: str, legend: bool) -> dict[str, Any]:
    drawn: dict[str, Any] = {
        "name": trace.name,
        "x": packed(trace.x),
        "y": packed(trace.y),
        "yaxis": y_axis,
        "showlegend": legend,
        "legendgroup": trace.name,
        "meta": {"role": trace.role},
        "hovertemplate": "%{y:.4g}",
    }
    match trace.kind:
        case "line":
            drawn |= {"type": "scatter", "mode": "lines", "line": {"width": 1.3, "dash": trace.dash}}
        case "points":
            drawn |= {"type": "scatter", "mode": "markers", "marker": {"size": 3, "opacity": 0.6}}
        case "bars":
            drawn |= {"type": "bar"}
        case other:
            raise AssertionError(f"unknown kind of trace: {other}")
    return drawn
