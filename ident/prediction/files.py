"""`predict.json`, `predict.parquet`, `predict.csv` and a plot, from a Prediction. Nothing is judged here.

predict.parquet has, at the log's rate and for each channel X: X and X_predicted behind the position filter,
X_band (half width of the 95 % band), all in N m [N], and X_outside: inside a stretch that leaves the band.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ident.export.saved import TextTable
from ident.prediction.prediction import ALPHA, Excursion, Prediction

POINTS = 4000  # of a drawn line


@dataclass(frozen=True, slots=True)
class Drawn:
    """What the plot shows: t (m,), measured, predicted, band (m, channels)."""

    t: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray
    band: np.ndarray


def write_prediction(found: Prediction, folder: Path) -> dict[str, Any]:
    """All files into an existing folder; the content of predict.json comes back."""
    inside, full_rate, drawn = _write_parquet(found, folder / "predict.parquet")
    document = prediction_document(found, inside, full_rate)
    _draw(found, drawn, folder / "predict.svg")
    return document


def prediction_document(
    found: Prediction, inside: Mapping[str, float], full_rate: Mapping[str, float]
) -> dict[str, Any]:
    """The content of predict.json."""
    return {
        "recording": found.stream.label,
        "robot": found.fit.columns.model.robot_name,
        "model": found.fit.study.model,
        "payload": found.stream.payload,
        "verdict": "outside" if found.excursions else "inside",
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
    """Header and rows: error, share inside the band, number of stretches outside, per channel."""
    rows: list[tuple[str, ...]] = []
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
    kept: list[np.ndarray] = []
    stride = max(1, found.stream.survey.rows // POINTS)
    writer: Any = None
    try:
        for t, measured, predicted in found.full_rate():
            band, counts = found.band(t), found.judged(t)
            error = measured - predicted
            inside += np.sum((np.abs(error) <= band) & counts, axis=0)
            judged += counts.sum(axis=0)
            above += np.sum(error**2, axis=0)
            below += np.sum(measured**2, axis=0)
            columns: dict[str, Any] = {"t": t}
            for k, name in enumerate(channels):
                columns |= {
                    name: measured[:, k],
                    f"{name}_predicted": predicted[:, k],
                    f"{name}_band": band[:, k],
                    f"{name}_outside": _outside(found, name, t),
                }
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
    share = 100 * inside / np.maximum(judged, 1)
    drawn = Drawn(rows[:, 0], rows[:, 1 : 1 + n], rows[:, 1 + n : 1 + 2 * n], rows[:, 1 + 2 * n :])
    drawn = replace(drawn, band=np.where(np.isfinite(drawn.band), drawn.band, np.nan))
    return {name: float(s) for name, s, j in zip(channels, share, judged) if j}, errors, drawn


def _outside(found: Prediction, name: str, t: np.ndarray) -> np.ndarray:
    out = np.zeros(len(t), bool)
    for item in found.excursions:
        if item.channel == name:
            out |= (t >= item.start) & (t <= item.stop)
    return out


def _draw(found: Prediction, drawn: Drawn, path: Path) -> None:
    """Per channel: measured and predicted torque; the error in its band, stretches outside shaded."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    channels = found.fit.columns.channels
    figure = Figure(figsize=(11, 1.9 * len(channels)))
    FigureCanvasSVG(figure)
    axes = figure.subplots(len(channels), 2, sharex=True, squeeze=False)
    for k, name in enumerate(channels):
        torque, error = axes[k]
        torque.plot(drawn.t, drawn.measured[:, k], "r", lw=0.7, label="measured")
        torque.plot(drawn.t, drawn.predicted[:, k], "b", lw=0.7, label="predicted")
        torque.set_ylabel(name)
        error.fill_between(drawn.t, -drawn.band[:, k], drawn.band[:, k], color="0.85", label="95 % band")
        error.plot(drawn.t, drawn.measured[:, k] - drawn.predicted[:, k], "k", lw=0.6, label="error")
        for item in found.excursions:
            if item.channel == name:
                error.axvspan(item.start, item.stop, color="orange", alpha=0.35, lw=0)
        for ax in (torque, error):
            ax.margins(x=0)
    axes[0][0].legend(loc="upper right", fontsize="x-small")
    axes[0][1].legend(loc="upper right", fontsize="x-small")
    axes[-1][0].set_xlabel("t [s]")
    axes[-1][1].set_xlabel("t [s]")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
