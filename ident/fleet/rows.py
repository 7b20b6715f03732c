"""From summaries to fleet.parquet: a row for each robot and window, and for each recording that failed."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ident.errors import IdentError
from ident.fleet.jobs import Job
from ident.fleet.trends import Point
from ident.summaries.arrow import array
from ident.summaries.file import Summary
from ident.summaries.solve import SummaryFit, fit_window
from ident.summaries.window import Window, merged

FIRST = ("robot", "day", "recording", "start", "stop", "seconds", "rows", "error_percent")
LAST = ("checks", "findings", "reason")
Fitted = SummaryFit | IdentError


def table(
    jobs: Sequence[Job],
    summaries: Mapping[Job, Summary],
    reasons: Mapping[Job, str],
    findings: Mapping[Job, Sequence[str]],
    fits: Mapping[Job, Sequence[Fitted]],
) -> bytes:
    """fleet.parquet: the same bytes for the same summaries, whoever made them; `fits` of each window."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows: list[dict[str, Any]] = []
    for job in jobs:
        who: dict[str, Any] = {"robot": job.robot, "day": job.day, "recording": job.url}
        who |= {"findings": list(findings.get(job, ())), "checks": [], "reason": reasons.get(job, "")}
        summary = summaries.get(job)
        if summary is None:
            rows.append(who)
            continue
        who["checks"] = list(summary.header.checks)
        rows += [who | _row(window, fit, summary) for window, fit in zip(summary.windows, fits[job])]
    names = [name for summary in summaries.values() for name in _names(summary)]
    order = [*FIRST, *dict.fromkeys(names), *LAST]
    texts = {"robot": pa.string(), "day": pa.string(), "recording": pa.string(), "reason": pa.string()}
    lists = {"checks": pa.list_(pa.string()), "findings": pa.list_(pa.string())}
    kinds = texts | lists | {"rows": pa.int64()}
    columns = {name: array([row.get(name) for row in rows], kinds.get(name, pa.float64())) for name in order}
    out = io.BytesIO()
    pq.write_table(pa.table(columns), out, compression="zstd")
    return out.getvalue()


def _names(summary: Summary) -> list[str]:
    head = summary.header
    names = [f"error_percent.{name}" for name in head.channels]
    names += [f"{kind}.{name}" for name in head.parameters for kind in ("value", "std")]
    return names + [f"{kind}.{joint}" for kind in ("heat", "speed", "load") for joint in head.joints]


def _row(window: Window, fit: Fitted, summary: Summary) -> dict[str, Any]:
    head = summary.header
    row: dict[str, Any] = {name: getattr(window, name) for name in ("start", "stop", "seconds", "rows")}
    for kind in ("heat", "speed", "load"):
        means = getattr(window, kind) / max(window.seconds, 1e-12)
        row |= {f"{kind}.{joint}": float(mean) for joint, mean in zip(head.joints, means)}
    if isinstance(fit, IdentError):
        return row | {"reason": str(fit)}
    row["error_percent"] = error_of(fit, window)
    row |= {f"error_percent.{name}": float(e) for name, e in zip(head.channels, fit.error_percent)}
    for kind, values in (("value", fit.values), ("std", fit.std)):
        row |= {
            f"{kind}.{name}": None if np.isnan(value) else float(value)
            for name, value in zip(head.parameters, values)
        }
    return row


def error_of(fit: SummaryFit, window: Window) -> float:
    """Of all channels together, in percent of the unweighted torque."""
    squares = [float(np.sum(factor.R[:, -1] ** 2)) for factor in window.factors]
    above = sum(s * (e / 100) ** 2 for s, e in zip(squares, fit.error_percent))
    return float(100 * np.sqrt(above / max(sum(squares), 1e-300)))


def fitted(window: Window, parameters: tuple[str, ...]) -> Fitted:
    """The fit of a window, or why it carries none."""
    try:
        return fit_window(window, parameters)
    except IdentError as error:
        return error


def point(job: Job, summary: Summary, fits: Sequence[Fitted]) -> Point | None:
    """One recording (`fits` of its windows) as a point of its robot's trend; None where it carries no fit."""
    whole = merged(summary.windows)
    fit = fits[0] if len(fits) == 1 else fitted(whole, summary.header.parameters)
    if isinstance(fit, IdentError):
        return None
    seconds = max(whole.seconds, 1e-12)
    motion = (whole.heat / seconds, whole.speed / seconds, whole.load / seconds)
    return Point(job.robot, job.day, fit.values, fit.covariance, *motion, error_of(fit, whole))
