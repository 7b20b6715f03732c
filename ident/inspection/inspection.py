"""`ident inspect` as a value: every log's columns and clock, what is wrong with it, what its motion shows.

A trial study stands in for what is not known yet (effort as motor torque, gains of one), so that the checks
that fit uses, and the regressor, can be asked before anything is filled in; no torque of it is believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import yaml

from ident.cores import one_blas_thread
from ident.errors import IdentError, StudyError
from ident.examination.check import Check, worst_first
from ident.inspection.excitation import Excitation, excitation
from ident.inspection.profile import TableProfile, profile
from ident.inspection.proposal import Proposal, clock, propose
from ident.inspection.study_text import Source, study_text, trial_text
from ident.progress import Progress, silent
from ident.recordings.recording import RecordingStream, Survey
from ident.recordings.study import study_from
from ident.recordings.tables import one_episode, open_table
from ident.recordings.tables.episodes import episodes_of
from ident.report.joints import Names, joints_of_robot, names_in

MOST_EPISODES = 12  # of one file
DRAWN = 1500  # samples of a curve on the page


@dataclass(frozen=True, slots=True)
class Log:
    """One recording. `survey` and `curves` are None and empty where it could not be opened as the study has
    it; `refusal` then is the sentence that says why. curves: {"q" | "motor" | "sensor": {column: (t, x)}}."""

    label: str
    file: str
    table: TableProfile
    survey: Survey | None
    notes: tuple[str, ...]
    checks: tuple[Check, ...]
    refusal: str
    curves: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]

    @property
    def rest_s(self) -> float:
        segments = self.survey.segments if self.survey else ()
        return sum(s.move_start - s.start + s.end - s.move_end for s in segments)

    @property
    def length_s(self) -> float:
        return self.survey.segments[-1].end - self.survey.segments[0].start if self.survey else float("nan")


@dataclass(frozen=True, slots=True)
class Inspection:
    """What `ident inspect` found, and the study file it would write."""

    robot: str
    logs: tuple[Log, ...]
    proposal: Proposal
    excitation: Excitation | None
    excitation_refusal: str
    study: str
    robot_notes: tuple[str, ...] = ()  # what was rounded in reading it
    joints: Names = field(default_factory=dict)  # the names that it gives them
    of_fit: tuple[Check, ...] = ()  # of limits; what a quick fit shows, where the torques' meaning is known

    @property
    def checks(self) -> tuple[Check, ...]:
        return worst_first([*(check for log in self.logs for check in log.checks), *self.of_fit])

    @property
    def questions(self) -> tuple[str, ...]:
        """Lines of the study that are still to be filled in."""
        return tuple(line.strip() for line in self.study.splitlines() if "FILL IN" in line.split("#")[0])


def inspect_recordings(
    files: Sequence[Path],
    robot: str | None,
    folder: Path,
    progress: Progress = silent,
    topic: str | None = None,
    exact: bool = False,
) -> Inspection:
    """Look into logs, with a robot (built-in name, robot file, URDF) or without; `folder` is where the study
    will stand, `topic` the one to read of bags that have several, `exact` as in a study. Raises IdentError
    for what is no table."""
    names: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    joints: Names = {}
    if robot is not None:
        from modelgen.geometry.robot_file import load_robot

        progress("reading the robot")
        loaded = load_robot(robot, exact)
        names, notes = tuple(loaded.joint_names), loaded.remarks
        joints = names_in(joints_of_robot(loaded))
    tables, sources = [], []
    for k, file in enumerate(files):
        progress(f"reading {file.name}", k / len(files))
        table = open_table(file, topic=topic)
        _, episodes = episodes_of(table)
        if len(episodes) > MOST_EPISODES:
            notes += (f"{file.name} holds {len(episodes)} episodes, {MOST_EPISODES} were looked at",)
        several: Sequence[int | None] = episodes[:MOST_EPISODES] if len(episodes) > 1 else (None,)
        sources += [Source(file, episode) for episode in several]
        tables += [profile(one_episode(table, episode)) for episode in several]
    proposal = propose(tables[0], names, len(names))
    text = study_text(sources, [_span(table) for table in tables], proposal, robot, folder, topic, exact)
    logs = tuple(
        Log(source.label, str(source.file), table, None, (), (), "", {})
        for source, table in zip(sources, tables)
    )
    inspection = Inspection(robot or "", logs, proposal, None, "", text, notes, joints)
    return inspection if robot is None else _tried(inspection, sources, folder, progress)


def _span(table: TableProfile) -> tuple[float, float] | None:
    """First and last second by the column that is taken for the time, None without one in a known unit."""
    name, scale = clock(table)
    t = table.column(name)
    return None if t is None or scale is None else (t.lowest * scale, t.highest * scale)


def _tried(inspection: Inspection, sources: Sequence[Source], folder: Path, progress: Progress) -> Inspection:
    """Open the logs as a study would, and ask the regressor."""
    from ident.equations.prepared import columns_of, prepare_study
    from ident.examination.examine import examine_fit
    from ident.examination.tables.limits import beyond_limits
    from ident.recordings.opening import open_recording

    text = trial_text(inspection.study, inspection.proposal)
    try:
        study = study_from(yaml.safe_load(text), folder / "study.yaml")
        columns = columns_of(study)
    except StudyError as error:
        return replace(inspection, excitation_refusal=str(error))
    logs, good = [], []
    for k, log in enumerate(inspection.logs):
        progress(f"examining {log.label}", k / len(sources))
        file, episode = sources[k].file.resolve(), sources[k].episode
        entries = [
            entry
            for entry in study.recordings
            if study.recording_path(entry).resolve() == file and entry.episode == episode
        ]
        try:
            whole = entries[0].model_copy(update={"from_s": None, "to_s": None, "name": log.label})
            stream = open_recording(study, whole, columns.need, columns.model.prismatic)
        except IdentError as error:
            logs.append(replace(log, refusal=str(error)))
            continue
        good += entries
        drawn = _curves(stream)
        logs.append(
            replace(log, survey=stream.survey, notes=stream.notes, checks=stream.checks, curves=drawn)
        )
    progress("evaluating the regressor")
    inspection = replace(inspection, logs=tuple(logs), excitation_refusal="no recording could be opened")
    if not any(entry.use == "identify" for entry in good):
        return inspection
    try:
        prepared = prepare_study(study.with_(recordings=tuple(good)))
        shown, limits = excitation(prepared), tuple(beyond_limits(prepared, not inspection.questions))
        inspection = replace(inspection, excitation=shown, excitation_refusal="", of_fit=limits)
        if not inspection.questions:
            progress("examining the torques")
            with one_blas_thread():
                inspection = replace(inspection, of_fit=(*limits, *examine_fit(prepared)))
    except IdentError as error:
        inspection = replace(inspection, excitation_refusal=str(error))
    return inspection


def _curves(stream: RecordingStream) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """A few samples a signal, spread over the whole recording, under the names of their columns."""
    need = stream.need
    kinds = ["q"] * len(need.joints) + ["motor"] * len(need.motor) + ["sensor"] * len(need.sensor)
    every = max(stream.survey.rows // DRAWN, 1)
    times, rows, seen = [], [], 0
    for segment, blocks in stream.segments():
        at = segment.start
        for values in blocks:
            picks = np.arange(-seen % every, len(values), every)
            times.append(at + picks / stream.rate_hz)
            rows.append(values[picks])
            at += len(values) / stream.rate_hz
            seen += len(values)
    t, values = np.concatenate(times), np.concatenate(rows)
    found: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]] = {}
    for k, (kind, name) in enumerate(zip(kinds, stream.names[-len(kinds) :])):
        found.setdefault(kind, {})[name] = (t, values[:, k])
    return found
