"""A log without torques: its motion is predicted and compared with nothing."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, fields, replace

import numpy as np

from ident.errors import RecordingError, StudyError
from ident.examination.check import Check  # noqa: F401  types of inherited fields, which pdoc looks up here
from ident.recordings.need import Need
from ident.recordings.opening import open_recording
from ident.recordings.recording import Mending, RecordingStream, Spread, Survey, Ticks  # noqa: F401
from ident.recordings.signal_columns import signal_columns
from ident.recordings.study import RecordingEntry, Role, Study  # noqa: F401
from ident.recordings.tables import Table, one_episode, open_table


@dataclass(frozen=True, slots=True)
class TorqueFree(RecordingStream):
    """A recording of positions alone; where a model's equations ask for torques (`wanted`), they get zeros,
    which nobody may judge."""

    wanted: Need | None = None

    def split(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
        """Columns of a block (N, 2 n) -> q (N, n), zeros where the fit has motor torques or sensors."""
        assert self.wanted is not None
        zeros = [np.zeros((len(values), len(which))) if which else None
                 for which in (self.wanted.motor, self.wanted.sensor)]  # fmt: skip
        return values[:, : len(self.need.joints)], zeros[0], zeros[1]


def open_log(
    study: Study, entry: RecordingEntry, need: Need, prismatic: Collection[str] = ()
) -> RecordingStream:
    """A recording as the fit's own are opened, or a TorqueFree one where it holds none of the torques.

    One that holds some of them is refused as every other incomplete recording. Raises RecordingError,
    StudyError.
    """
    source = study.recording_path(entry) if entry.table is None else entry.table
    table = one_episode(open_table(source, entry.decimal, entry.label, entry.topic), entry.episode)
    bare = replace(need, motor=(), sensor=())
    torques = [replace(bare, motor=(k,)) for k in need.motor]
    torques += [replace(bare, sensor=(k,)) for k in need.sensor]
    # positions of the links are made of torques
    if study.positions == "joint" or not _has(study, entry, bare, table):
        return open_recording(study, entry, need, prismatic)
    if any(_has(study, entry, one, table) for one in torques):
        return open_recording(study, entry, need, prismatic)
    return motion_alone(study, entry, need, prismatic)


def motion_alone(
    study: Study, entry: RecordingEntry, need: Need, prismatic: Collection[str] = ()
) -> TorqueFree:
    """A recording without its torques, whatever it holds of them. Raises RecordingError, StudyError."""
    stream = open_recording(study, entry, replace(need, motor=(), sensor=()), prismatic)
    return TorqueFree(
        **{its.name: getattr(stream, its.name) for its in fields(stream) if its.init}, wanted=need
    )


def _has(study: Study, entry: RecordingEntry, need: Need, table: Table) -> bool:
    """Whether a table has the columns; what is there and not understood counts as there."""
    try:
        signal_columns(study, entry, need, table)
    except StudyError:
        return True
    except RecordingError:
        return False
    return True
