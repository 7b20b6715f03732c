"""A night of a fleet: every recording summarised once, the table and the trends from summaries alone.

Summaries are kept in `summaries/ROBOT/` as they come, named by a hash of file, robot model and study: a run
that was killed, or is repeated with more recordings, reads what is there and computes the rest.
"""

from __future__ import annotations

import datetime
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ident.fleet import work
from ident.fleet.jobs import FleetError, Job, find, robots_of
from ident.fleet.run import connected, run
from ident.output import write_file
from ident.progress import Progress, silent
from ident.recordings.study import RecordingEntry, Study, load_study, study_from
from ident.summaries.file import Summary, read, together
from ident.summaries.window import SummaryError

if TYPE_CHECKING:  # imported where they are used: by then workers are at work
    from ident.fleet.rows import Fitted
    from ident.fleet.trends import Trends

SUMMARIES = "summaries"
A_YEAR = 365.25


@dataclass(frozen=True, slots=True)
class Fleet:
    """What a run found: jobs in order, summaries, reasons of those without, findings, the table's bytes."""

    jobs: tuple[Job, ...]
    summaries: Mapping[Job, Summary]
    reasons: Mapping[Job, str]
    findings: Mapping[Job, tuple[str, ...]]
    table: bytes
    trends: Trends | None
    notes: tuple[str, ...] = ()

    @property
    def robots(self) -> tuple[str, ...]:
        return robots_of(self.jobs)


def study_keys(robot: str, study: Path | None) -> dict[str, Any]:
    """The keys of every recording's study, checked before any of them is opened. Raises IdentError."""
    from ident.equations.prepared import columns_of

    known: dict[str, Any] = {}
    folder = Path.cwd()
    if study is not None:
        its = load_study(study)
        known = its.model_dump(mode="json", exclude_unset=True, exclude={"recordings", "robot", "folder"})
        folder = study.resolve().parent
    robot = str(Path(robot).resolve()) if Path(robot).is_file() else robot
    entries = [RecordingEntry(file="recording.parquet", use="identify")]
    checked = study_from({**known, "robot": robot, "recordings": entries}, folder / "the study of the fleet")
    if checked.estimator != "wls" or checked.robust or checked.controller:
        raise FleetError(
            f"{study}: a fleet adds up summaries by weighted least squares; leave estimator, robust and "
            "controller out"
        )
    columns_of(checked)
    return {**known, "robot": robot}


def settings_of(keys: Mapping[str, Any]) -> str:
    """What summaries depend on beside their recording, as text; a robot file by its content."""
    file = Path(keys["robot"])
    content = hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
    return json.dumps([dict(keys), content], sort_keys=True, default=str)


def jobs_of(source: str, keys: Mapping[str, Any]) -> tuple[Job, ...]:
    """The recordings of a pattern or table. Raises IdentError where it names none, or cannot be reached."""
    return find(source, settings_of(keys))


def run_fleet(
    jobs: Sequence[Job],
    keys: Mapping[str, Any],
    folder: Path,
    scheduler: str | None = None,
    diagnose: bool = True,
    progress: Progress = silent,
) -> Fleet:
    """Summaries into `folder`, the rest as a value. Raises IdentError for what concerns the whole fleet."""
    with connected(scheduler) as client:
        summaries, fits, reasons = _summaries(jobs, keys, folder, client, progress)
        kept = [job for job in jobs if job in summaries]
        if not kept:
            first = reasons[jobs[0]]
            raise FleetError(f"none of {len(jobs)} recordings could be used; the first: {first}")
        from ident.fleet.rows import point, table
        from ident.fleet.trends import trends

        head = _apart(kept, summaries, reasons)
        progress("trends")
        points = [p for job in kept if job in summaries and (p := point(job, summaries[job], fits[job]))]
        found = trends(points, head.parameters, head.joints, a_year(points)) if points else None
        findings = _findings(jobs, summaries, found, keys, client, progress) if diagnose and found else {}
    progress("writing the table")
    data = table(jobs, summaries, reasons, findings, fits)
    return Fleet(tuple(jobs), summaries, reasons, findings, data, found)


def _summaries(
    jobs: Sequence[Job], keys: Mapping[str, Any], folder: Path, client: Any, progress: Progress
) -> tuple[dict[Job, Summary], dict[Job, list[Fitted]], dict[Job, str]]:
    """Summaries, the fit of each of their windows, and why there is none; while workers work, what is there
    is read and fitted."""
    done: dict[Job, Summary] = {}
    fits: dict[Job, list[Fitted]] = {}
    reasons: dict[Job, str] = {}

    def keep(job: Job, data: bytes, path: Path) -> None:
        from ident.fleet.rows import fitted

        done[job] = read(data, str(path))
        fits[job] = [fitted(window, done[job].header.parameters) for window in done[job].windows]

    for job in jobs:
        if (path := _place(folder, job)).is_file():
            try:
                keep(job, path.read_bytes(), path)
            except SummaryError:
                continue  # half a file of another program; it is made again
    left = [job for job in jobs if job not in done]
    coming = run(left, work.summarised, (dict(keys), str(Path.cwd())), client)
    for number, (job, came) in enumerate(coming, 1):
        if came.data:
            path = _place(folder, job)
            write_file(path, came.data, overwrite=True)
            keep(job, came.data, path)
        else:
            reasons[job] = came.reason
        progress("summarising recordings", number / len(left))
    return done, fits, reasons


def _place(folder: Path, job: Job) -> Path:
    """Where the summary of a recording is kept."""
    return folder / SUMMARIES / _safe(job.robot) / job.file


def _safe(robot: str) -> str:
    """A robot's name as a folder."""
    plain = "".join(c if c.isalnum() or c in "._-" else "_" for c in robot)[:80]
    return plain if plain == robot else f"{plain}-{hashlib.sha256(robot.encode()).hexdigest()[:8]}"


def _apart(jobs: Sequence[Job], summaries: dict[Job, Summary], reasons: dict[Job, str]) -> Any:
    """The header that most share; a summary that was made otherwise becomes a reason."""
    first = summaries[jobs[0]]
    for job in jobs[1:]:
        try:
            together([first, summaries[job]], [jobs[0].url, job.url])
        except SummaryError as error:
            reasons[job] = str(error)
            del summaries[job]
    return first.header


def a_year(points: Sequence[Any]) -> float:
    """Observations of a robot in a year: from days that are dates, else one a day."""
    days = sorted({p.day for p in points})
    try:
        dates = [datetime.date.fromisoformat(day).toordinal() for day in days]
    except ValueError:
        return A_YEAR
    steps = np.diff(sorted(set(dates)))
    return A_YEAR / float(np.median(steps)) if len(steps) else A_YEAR


def _findings(
    jobs: Sequence[Job],
    summaries: Mapping[Job, Summary],
    found: Trends,
    keys: Mapping[str, Any],
    client: Any,
    progress: Progress,
) -> dict[Job, tuple[str, ...]]:
    """A diagnosis of the last recording of each robot that changed."""
    changed = {change.robot for change in found.changes}
    last = {job.robot: job for job in jobs if job in summaries and job.robot in changed}
    last = {robot: job for robot, job in last.items() if not job.url.endswith(".ident.parquet")}
    out: dict[Job, tuple[str, ...]] = {}
    for number, (job, came) in enumerate(
        run(list(last.values()), work.diagnosed, (dict(keys), str(Path.cwd())), client), 1
    ):
        out[job] = tuple(came.data.decode().split("\n")) if came.data else (f"no diagnosis: {came.reason}",)
        progress("diagnosing what changed", number / len(last))
    return out


__all__ = ["Fleet", "Study", "jobs_of", "run_fleet", "study_keys"]
