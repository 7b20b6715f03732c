"""Recordings: from somebody's table to uniform samples in SI units, and what was done to get there.

`open_recordings(study, joints, need)` opens every recording of a study and surveys it once (time stamps,
gaps, repeats, rest, units). `RecordingStream.segments()` then yields its uninterrupted stretches as blocks
of uniform samples, however long the log is; `RecordingStream.load()` holds them whole as `Recording` values.

What is wrong with a table is found on the way and said as `checks` (examination/): mended, warned of, or
refused. What is only done and noted (`notes`): rows whose time stamp repeats, rows that repeat the previous
one (the same state read twice: dropped where single, so that motion is interpolated across them), jitter
(resampled), gaps (the recording is split, never bridged), rest at both ends (not fitted).
"""

from __future__ import annotations

import difflib
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ident.errors import RecordingError, StudyError
from ident.examination.check import refuse, worst_first
from ident.examination.clock import time_stamps, uniform_clock
from ident.examination.signals import Columns, of_table
from ident.examination.velocity import velocity_agrees
from ident.recordings.need import Need as Need
from ident.recordings.need import need_of as need_of
from ident.recordings.recording import RecordingStream, Survey
from ident.recordings.remarks import notes_on
from ident.recordings.study import ColumnMap, RecordingEntry, Study
from ident.recordings.surveying import surveyed
from ident.recordings.tables import Table, open_table


def open_recordings(study: Study, need: Need, prismatic: Collection[str] = ()) -> list[RecordingStream]:
    """Open and survey every recording of a study, in its order; `prismatic` joints by their label."""
    return [open_recording(study, entry, need, prismatic) for entry in study.recordings]


def open_recording(
    study: Study, entry: RecordingEntry, need: Need, prismatic: Collection[str] = ()
) -> RecordingStream:
    """Find the columns, survey the rows. Raises RecordingError or StudyError."""
    _check_sizes(study, need)
    path = study.recording_path(entry)
    table = open_table(path if entry.table is None else entry.table, entry.decimal, entry.label)
    names, signals, factors, offsets = _columns(study, entry, need, table)
    window = (-np.inf if entry.from_s is None else entry.from_s, np.inf if entry.to_s is None else entry.to_s)
    stiffness = np.array(study.stiffness) if study.positions == "joint" and study.stiffness else None
    stream = RecordingStream(
        entry.label,
        entry.use,
        entry.payload,
        str(path),
        need,
        table,
        names,
        factors,
        offsets,
        entry.rate_hz if signals[0] != "t" else None,
        window,
        stiffness,
        _NO_SURVEY,
    )
    seen, checks = surveyed(stream, study), []
    if seen.bursts and stream.counted_rate_hz is None:
        stamps = table.blocks(names[:1])
        clock = uniform_clock((b[:, 0] * factors[0] + offsets[0] for b in stamps), window)
        checks.append(time_stamps(stream.label, clock, seen.bursts, seen.survey.rows))
        refuse(stream.file, checks)
        stream = replace(
            stream,
            names=names[1:],
            factors=factors[1:],
            offsets=offsets[1:],
            counted_rate_hz=clock.rate_hz,
            counted_from_s=clock.start,
        )
        seen = surveyed(stream, study)
    columns = Columns(
        stream.label,
        tuple(signal for signal in signals if signal != "t"),
        stream.signal_joints,
        tuple(str(joint) for joint in need.joints),
        {**study.columns, **entry.columns},
        need.names,
        np.array([str(joint) in prismatic for joint in need.joints]),
    )
    survey = seen.survey
    checks += of_table(columns, seen.mender, seen.excerpt, survey.lowest, survey.highest, survey.rows)
    checks += velocity_agrees(columns, stream, table)
    refuse(stream.file, checks)
    notes = (*table.remarks, *notes_on(stream.label, survey))
    return replace(stream, survey=survey, notes=notes, checks=worst_first(checks))


def _check_sizes(study: Study, need: Need) -> None:
    n = len(need.joints)
    for key, values in (("drive_gains", study.drive_gains), ("stiffness", study.stiffness)):
        if isinstance(values, tuple) and len(values) != n:
            raise StudyError(
                str(study.file),
                key,
                f"has {len(values)} values, the robot {study.robot} has {n} joints; give one per joint",
            )


def _columns(
    study: Study, entry: RecordingEntry, need: Need, table: Table
) -> tuple[tuple[str, ...], tuple[str, ...], np.ndarray, np.ndarray]:
    """The table's columns for t, q, motor, sensor, which signals they are, their factors and offsets."""
    maps = {**study.columns, **entry.columns}
    known = {"t"} | {f"{kind}{j}" for kind in ("q", "dq", "ddq", "tau_m", "tau_l", "i") for j in need.joints}
    for name in maps:
        if name not in known:
            close = difflib.get_close_matches(name, sorted(known), n=1)
            raise StudyError(
                str(study.file),
                f"columns.{name}",
                "is not a signal of this robot"
                + (f", did you mean {close[0]}?" if close else "; signals are t, q1, tau_m1, tau_l1, i1 ..."),
            )
    names: list[str] = []
    factors: list[float] = []
    offsets: list[float] = []
    found: list[str] = []

    def add(signal: str, factor: float = 1.0) -> None:
        column = maps.get(signal, ColumnMap(column=signal))
        where = str(column.column)
        if isinstance(column.column, int):
            if not 0 <= column.column < len(table.columns):
                raise RecordingError(
                    table.file,
                    f"has {len(table.columns)} columns, so column {column.column} for "
                    f"{signal} does not exist (the first is 0); correct the study's columns",
                )
            where = table.columns[column.column]
        if where not in table.columns:
            raise _missing(table, signal, where, signal in maps)
        names.append(where)
        factors.append(column.sign * column.scale * factor)
        offsets.append(column.offset * factor)
        found.append(signal)

    def has(signal: str) -> bool:
        return signal in maps or signal in table.columns

    if has("t") or entry.rate_hz is None:
        add("t")
    for j in need.joints:
        add(f"q{j}")
    if need.motor:
        gains = study.drive_gains
        currents = all(has(f"i{need.joints[k]}") for k in need.motor)
        for k in need.motor:
            j = need.joints[k]
            if gains == "identify":
                add(f"i{j}" if currents else f"tau_m{j}")
            elif isinstance(gains, tuple) and currents:
                add(f"i{j}", gains[k])
            elif not has(f"tau_m{j}") and has(f"i{j}"):
                raise StudyError(
                    str(study.file),
                    "drive_gains",
                    f"{entry.file} holds motor currents; give one gain "
                    "[N m/A] per joint, or drive_gains: identify where joint torques are recorded too",
                )
            else:
                add(f"tau_m{j}")
    if need.sensor:
        for k in need.sensor:
            add(f"tau_l{need.joints[k]}")
    return tuple(names), tuple(found), np.array(factors), np.array(offsets)


def _missing(table: Table, signal: str, where: str, mapped: bool) -> RecordingError:
    if not table.has_names:
        return RecordingError(
            table.file,
            f"has no header, so {signal} must be told by its index; "
            f"add columns: {{{signal}: {{column: 0}}}} (the first is 0) to the study",
        )
    close = difflib.get_close_matches(where, table.columns, n=1, cutoff=0.6)
    columns = ", ".join(table.columns[:12]) + (" ..." if len(table.columns) > 12 else "")
    hint = f"the nearest is {close[0]}" if close else f"the columns are {columns}"
    if signal == "t" and not mapped:
        return RecordingError(
            table.file,
            f"column t is missing ({hint}); map it with columns: {{t: ...}}, or give "
            "rate_hz: beside the file when samples are uniform",
        )
    return RecordingError(
        table.file,
        f"column {where} is missing ({hint}); map it in the study with "
        f"columns: {{{signal}: {{column: NAME}}}}",
    )


_NO_SURVEY = Survey(0, 1.0, True, 0.0, 0, 0, 0, np.empty(0), np.empty(0), (), np.inf, 0)
