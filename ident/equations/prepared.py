"""A study opened: its compiled model, the columns of its equations, every recording surveyed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ident.equations.columns import Columns, study_columns
from ident.errors import StudyError
from ident.examination.tables.signals import MOVED
from ident.progress import Progress, silent
from ident.recordings.need import need_of
from ident.recordings.opening import open_recordings
from ident.recordings.recording import RecordingStream
from ident.recordings.study import Study, expand
from ident.recordings.study_checks import within_rates
from ident.signals.filtering import FilterBank, prepare
from modelgen.errors import ModelgenError


@dataclass(frozen=True, slots=True)
class Prepared:
    """A study opened: the compiled model, its columns, every recording surveyed, with its filters."""

    study: Study
    model: Any
    columns: Columns
    streams: tuple[RecordingStream, ...]
    banks: tuple[FilterBank, ...]

    def again(self, study: Study) -> Prepared:
        """The same recordings, not read again, for a study that differs in its effects, in how friction turns
        over or in the decimation's cut-off alone. Torques come as late."""
        columns, banks = columns_of(study), banks_of(study, self.streams)
        banks = tuple(replace(bank, late=own.late) for bank, own in zip(banks, self.banks))
        return Prepared(study, columns.model, columns, self.streams, banks)

    def with_late(self, seconds: Sequence[Sequence[float]]) -> Prepared:
        """With torques that come late by so much, of each joint (filtering.py); itself where they do already,
        to the sample."""
        banks = tuple(bank.with_late(seconds) for bank in self.banks)
        same = all(bank.late == own.late for bank, own in zip(banks, self.banks))
        return self if same else replace(self, banks=banks)


def columns_of(study: Study) -> Columns:
    """The compiled model of a study and its columns; no recording is opened. Raises IdentError,
    GeneratedError, ModelgenError."""
    import generated

    if study.effects_folder is not None:
        _register(study)
    payload = study.payloads[0] if study.payloads else None
    source, gravity = study.robot_source, study.gravity
    model = generated.load(source, study.model, payload=payload, gravity=gravity, exact=study.exact)
    try:
        need = need_of(study.model, tuple(model.channels), study.positions, study.channels, model.joint_names)
    except (ValueError, ModelgenError) as error:
        raise StudyError(str(study.file), "channels", str(error)) from None
    return study_columns(study, model, need)


def _register(study: Study) -> None:
    """Make the effects of `effects_folder` known to fit and diagnosis."""
    from modelgen.effects import register_folder

    try:
        register_folder(study.path / expand(study.effects_folder or ""))
    except ModelgenError as error:
        raise StudyError(str(study.file), "effects_folder", str(error)) from None


def prepare_study(study: Study, progress: Progress = silent) -> Prepared:
    """Load the model, open and survey the recordings. Raises IdentError, GeneratedError, ModelgenError."""
    progress("loading the model")
    columns = columns_of(study)
    progress("reading the recordings")
    for key in ("turn_over", "presliding", "instant_sign"):
        values = getattr(study, key)
        if values is not None and len(values) != len(columns.need.joints):
            raise StudyError(
                str(study.file),
                key,
                f"has {len(values)} values, the robot {study.robot} has {len(columns.need.joints)} "
                "joints; give one per joint, 0 or false for one that keeps the plain sign",
            )
    if study.instant_sign is not None and not study.turn_overs:
        raise StudyError(
            str(study.file),
            "instant_sign",
            "says how a torque that turns over is recorded; give turn_over: or presliding: beside it",
        )
    streams = tuple(open_recordings(study, columns.need, columns.model.prismatic))
    study, streams = _filtered_as_recorded(study, streams)
    return Prepared(study, columns.model, columns, streams, banks_of(study, streams))


def _filtered_as_recorded(
    study: Study, streams: tuple[RecordingStream, ...]
) -> tuple[Study, tuple[RecordingStream, ...]]:
    """The study with the position filter that its slowest recording holds, which that one's notes say."""
    slowest = min(streams, key=lambda stream: stream.rate_hz)
    held = within_rates(study, slowest.rate_hz)
    if held is study:
        return study, streams
    note = (
        f"{slowest.label}: recorded at {slowest.rate_hz:.4g} Hz, so that positions are filtered at "
        f"{held.filter.position_cutoff_hz:g} Hz instead of {study.filter.position_cutoff_hz:g}"
    )
    return held, tuple(
        replace(stream, notes=(*stream.notes, note)) if stream is slowest else stream for stream in streams
    )


def banks_of(study: Study, streams: Sequence[RecordingStream]) -> tuple[FilterBank, ...]:
    """The filters of every recording."""
    resting = resting_joints(streams)
    return tuple(prepare(stream, study.filter, study.turn_overs, resting) for stream in streams)


def travel_of(streams: Sequence[RecordingStream]) -> np.ndarray:
    """(n,) from the lowest to the highest position of each joint in all recordings."""
    n = len(streams[0].need.joints)
    lowest = np.min([stream.survey.lowest[:n] for stream in streams], axis=0)
    return np.asarray(np.max([stream.survey.highest[:n] for stream in streams], axis=0) - lowest)


def travel_seen(streams: Sequence[RecordingStream]) -> tuple[float, ...]:
    """The same of all but test runs, which touch nothing: the ranges on which effects are placed."""
    return tuple(travel_of([s for s in streams if s.role != "test"] or streams).tolist())


def resting_joints(streams: Sequence[RecordingStream]) -> tuple[int, ...]:
    """Joints that stand at one place in every stretch of all recordings (of a robot that stands in poses all
    do), unless the whole robot stands at one. There its load moves no other torque that another link's would
    not: its own torque alone shows it, and may be a brake's without harm to the others."""
    still = set.intersection(*(set(its.resting) for stream in streams for its in stream.survey.segments))
    return () if (travel_of(streams) < MOVED).all() else tuple(sorted(still))
