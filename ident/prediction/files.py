"""`predict.json`, `predict.parquet`, `predict.csv` and a plot, from a Prediction. Nothing is judged here.

predict.parquet has, at the log's rate and for each channel X: X and X_predicted behind the position filter,
X_band (half width of the 95 % band), all in N m [N], and X_outside: inside a stretch that leaves the band. Of
a log without torques there are X_predicted and X_band.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ident.export.saved import TextTable
from ident.prediction.prediction import ALPHA, Excursion, Prediction
from ident.report.joints import joints_of

POINTS = 4000  # of a drawn line


@dataclass(frozen=True, slots=True)
class Drawn:
    """What the plot shows: t (m,), measured, predicted, band (m, channels); largest (channels,) predicted."""

    t: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray
    band: np.ndarray
    rms: np.ndarray
    largest: np.ndarray


def write_prediction(found: Prediction, folder: Path) -> dict[str, Any]:
    """All files into an existing folder; the content of predict.json comes back."""
    inside, full_rate, drawn = _write_parquet(found, folder / "predict.parquet")
    document = prediction_document(found, inside, full_rate, drawn)
    _draw(found, drawn, folder / "predict.svg")
    return document


def prediction_document(
    found: Prediction, inside: Mapping[str, float], full_rate: Mapping[str, float], drawn: Drawn
) -> dict[str, Any]:
    """The content of predict.json."""
    channels, verdict = found.fit.columns.channels, "outside" if found.excursions else "inside"
    return {
        "recording": found.stream.label,
        "robot": found.fit.columns.model.robot_name,
        "model": found.fit.study.model,
        "joints": joints_of(found.fit.columns.model),
        "payload": found.stream.payload,
        "verdict": verdict if found.compared else "not compared",
        "predicted_rms": dict(zip(channels, drawn.rms.tolist())),
        "predicted_largest": dict(zip(channels, drawn.largest.tolist())),
        "relative_error_percent": found.error_percent,
        "full_rate_error_percent": dict(full_rate),
        "rms": found.rms,
        "inside_band_percent": dict(inside),
        "band_percent": 95,
        "alpha": ALPHA,
        "judged_percent": found.judged_percent,
        "excursions": [_as_values(item) for item in found.excursions],
        "notes": list(found.stream.notes),
        "warnings": list(found.warnings),
    }


def _as_values(item: Excursion) -> dict[str, Any]:
    return {
        "channel": item.channel,
        "from": item.start,
        "to": item.stop,
        "kind": item.kind,
        "rms": item.rms,
        "mean": item.mean,
        "worst": item.worst,
        "times_usual": item.times_usual,
        "strength": item.strength,
    }


def channel_table(document: Mapping[str, Any]) -> TextTable:
    """Header and rows: error, share inside the band, number of stretches outside, per channel; of a log
    without torques the size of what is predicted."""
    rows: list[tuple[str, ...]] = []
    if not document["relative_error_percent"]:
        largest = document["predicted_largest"]
        rows = [
            (name, f"{rms:.4g}", f"{largest[name]:.4g}") for name, rms in document["predicted_rms"].items()
        ]
        return ("channel", "predicted rms N m", "largest N m"), rows
    for name, error in document["relative_error_percent"].items():
        outside = [item for item in document["excursions"] if item["channel"] == name]
        rows.append(
            (
                name,
                f"{error:.2f}",
                f"{document['rms'][name]:.3g}" if name in document["rms"] else "",
                f"{document['inside_band_percent'][name]:.1f}"
                if name in document["inside_band_percent"]
                else "",
                str(len(outside)) if name != "total" else str(len(document["excursions"])),
            )
        )
    return ("channel", "error %", "rms N m", "inside the 95 % band %", "stretches outside"), rows


def excursion_table(document: Mapping[str, Any], most: int = 12) -> TextTable:
    """Header and rows of the stretches that leave the band, strongest first."""
    header = ("channel", "from s", "to s", "mean N m", "worst N m", "times usual", "lasts")
    rows: list[tuple[str, ...]] = [
        (
            item["channel"],
            f"{item['from']:.2f}",
            f"{item['to']:.2f}",
            f"{item['mean']:+.3g}",
            f"{item['worst']:+.3g}",
            f"{item['times_usual']:.1f}",
            item["kind"],
        )
        for item in document["excursions"][:most]
    ]
    return header, rows


def _write_parquet(found: Prediction, path: Path) -> tuple[dict[str, float], dict[str, float], Drawn]:
    """Stream the log to the file; -> share inside the band of what is judged, errors, what to draw."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    channels = found.fit.columns.channels
    inside, judged = np.zeros(len(channels)), np.zeros(len(channels))
    above, below = np.zeros(len(channels)), np.zeros(len(channels))
    squares, largest, count = np.zeros(len(channels)), np.zeros(len(channels)), 0
    kept: list[np.ndarray] = []
    stride = max(1, found.stream.survey.rows // POINTS)
    writer: Any = None
    try:
        for t, measured, predicted in found.full_rate():
            band, counts = found.band(t), found.judged(t)
            squares, count = squares + np.sum(predicted**2, axis=0), count + len(t)
            largest = np.maximum(largest, np.abs(predicted).max(axis=0, initial=0.0))
            error = measured - predicted
            inside += np.sum((np.abs(error) <= band) & counts, axis=0)
            judged += counts.sum(axis=0)
            above += np.sum(error**2, axis=0)
            below += np.sum(measured**2, axis=0)
            columns: dict[str, Any] = {"t": t}
            for k, name in enumerate(channels):
                columns |= {name: measured[:, k]} if found.compared else {}
                columns |= {f"{name}_predicted": predicted[:, k], f"{name}_band": band[:, k]}
                columns |= {f"{name}_outside": _outside(found, name, t)} if found.compared else {}
            table = pa.table(columns)
            writer = writer or pq.ParquetWriter(path, table.schema)
            writer.write_table(table)
            kept.append(np.hstack([t[:, None], measured, predicted, band])[::stride])
    finally:
        if writer is not None:
            writer.close()
    rows = np.concatenate(kept) if kept else np.zeros((0, 1 + 3 * len(channels)))
    n = len(channels)
    errors = {"total": float(100 * np.sqrt(above.sum() / max(below.sum(), 1e-300)))}
    errors |= dict(zip(channels, (100 * np.sqrt(above / np.maximum(below, 1e-300))).tolist()))
    errors = errors if found.compared else {}
    rms = np.sqrt(squares / max(count, 1))
    share = 100 * inside / np.maximum(judged, 1)
    measured, predicted, band = (rows[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3))
    drawn = Drawn(rows[:, 0], measured, predicted, np.where(np.isfinite(band), band, np.nan), rms, largest)
    inside_of = {name: float(s) for name, s, j in zip(channels, share, judged) if j and found.compared}
    return inside_of, errors, drawn


def _outside(found: Prediction, name: str, t: np.ndarray) -> np.ndarray:
    out = np.zeros(len(t), bool)
    for item in found.excursions:
        if item.channel == name:
            out |= (t >= item.start) & (t <= item.stop)
    return out


def _draw(found: Prediction, drawn: Drawn, path: Path) -> None:
    """Per channel: measured and predicted torque; the error in its band, stretches outside shaded. Without
    torques: what is predicted, in its band."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    channels = found.fit.columns.channels
    figure = Figure(figsize=(11, 1.9 * len(channels)))
    FigureCanvasSVG(figure)
    axes = figure.subplots(len(channels), 2 if found.compared else 1, sharex=True, squeeze=False)
    for k, name in enumerate(channels):
        torque = axes[k][0]
        predicted, band = drawn.predicted[:, k], drawn.band[:, k]
        if found.compared:
            torque.plot(drawn.t, drawn.measured[:, k], "r", lw=0.7, label="measured")
        else:
            torque.fill_between(drawn.t, predicted - band, predicted + band, color="0.85", label="95 % band")
        torque.plot(drawn.t, predicted, "b", lw=0.7, label="predicted")
        torque.set_ylabel(name)
        torque.margins(x=0)
        if not found.compared:
            continue
        error = axes[k][1]
        error.fill_between(drawn.t, -band, band, color="0.85", label="95 % band")
        error.plot(drawn.t, drawn.measured[:, k] - predicted, "k", lw=0.6, label="error")
        for item in found.excursions:
            if item.channel == name:
                error.axvspan(item.start, item.stop, color="orange", alpha=0.35, lw=0)
        error.margins(x=0)
    for ax in axes[0]:
        ax.legend(loc="upper right", fontsize="x-small")
    for ax in axes[-1]:
        ax.set_xlabel("t [s]")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
