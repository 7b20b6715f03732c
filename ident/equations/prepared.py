"""A study opened: its compiled model, the columns of its equations, every recording surveyed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ident.equations.columns import Columns, study_columns
from ident.progress import Progress, silent
from ident.recordings.opening import need_of, open_recordings
from ident.recordings.recording import RecordingStream
from ident.recordings.study import Study
from ident.signals.filtering import FilterBank, prepare


@dataclass(frozen=True, slots=True)
class Prepared:
    """A study opened: the compiled model, its columns, every recording surveyed, with its filters."""

    study: Study
    model: Any
    columns: Columns
    streams: tuple[RecordingStream, ...]
    banks: tuple[FilterBank, ...]


def prepare_study(study: Study, progress: Progress = silent) -> Prepared:
    """Load the model, open and survey the recordings. Raises IdentError, GeneratedError, ModelgenError."""
    import generated

    progress("loading the model")
    payload = study.payloads[0] if study.payloads else None
    model = generated.load(study.robot_source, study.model, payload=payload)
    need = need_of(study.model, tuple(model.channels), study.positions)
    columns = study_columns(study, model, need)
    progress("reading the recordings")
    streams = tuple(open_recordings(study, need))
    banks = tuple(prepare(stream, study.filter) for stream in streams)
    return Prepared(study, model, columns, streams, banks)
