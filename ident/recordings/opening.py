"""Recordings: from somebody's table to uniform samples in SI units, and what was done to get there.

`open_recordings(study, joints, need)` opens every recording of a study and surveys it once (time stamps,
gaps, repeats, rest, units). `RecordingStream.segments()` then yields its uninterrupted stretches as blocks
of uniform samples, however long the log is.

What is wrong with a table is found on the way and said as `checks` (examination/): mended, warned of, or
refused. What is only done and noted (`notes`): rows whose time stamp repeats, rows that repeat the previous
one (the same state read twice: dropped where single, so that motion is interpolated across them), jitter
(resampled), gaps (the recording is split, never bridged), rest at both ends (not fitted).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ident.errors import StudyError
from ident.examination.check import Check, refuse, worst_first
from ident.examination.tables.clock import (
    Pace,
    late_stamps,
    rounded_stamps,
    stamps_on_ticks,
    time_stamps,
    time_unit_beside,
    uniform_clock,
)
from ident.examination.tables.lost_rows import lost_rows
from ident.examination.tables.of_table import more_joints, of_table
from ident.examination.tables.same_samples import fitted_twice
from ident.examination.tables.shared_stamps import Spread, spread, spread_stamps
from ident.examination.tables.signals import Columns, frozen_throughout
from ident.examination.tables.stopped import stopped_positions
from ident.examination.tables.ticks import ticks
from ident.examination.tables.uneven_stamps import (
    even_samples,
    scattering_stamps,
    uneven_stamps,
    uneven_steps,
)
from ident.examination.tables.velocity import velocity_agrees
from ident.recordings import study_checks
from ident.recordings.need import Need as Need
from ident.recordings.need import need_of as need_of
from ident.recordings.recording import RecordingStream, Survey
from ident.recordings.remarks import notes_on
from ident.recordings.signal_columns import signal_columns
from ident.recordings.study import RecordingEntry, Study
from ident.recordings.surveying import surveyed
from ident.recordings.tables import one_episode, open_table


def open_recordings(study: Study, need: Need, prismatic: Collection[str] = ()) -> list[RecordingStream]:
    """Open and survey every recording of a study, in its order, but for those in which nothing changes
    and copies of what is fitted; `prismatic` joints by their label."""
    streams = _once(_alive([open_recording(study, entry, need, prismatic) for entry in study.recordings]))
    paces = [_pace(stream) for stream in streams]
    for stream, its in zip(streams, paces):
        if stream.counted_rate_hz is None:
            check = time_unit_beside(its, [other for other in paces if other is not its])
            refuse(stream.file, [check] if check else [])
    return streams


def _alive(streams: Sequence[RecordingStream]) -> list[RecordingStream]:
    """Those in which anything changes, the first one with what is said of the others. (Of a judged run whose
    every row was the same all joints were told never to move, and its error of 37 % stood with the fit's.)
    Raises RecordingError where nothing is left to fit."""
    alive = [bool((stream.survey.highest > stream.survey.lowest).any()) for stream in streams]
    frozen, kept = (
        [stream for stream, its in zip(streams, alive) if its is which] for which in (False, True)
    )
    fitted = any(stream.role == "identify" for stream in kept)
    said = [frozen_throughout(stream.label, stream.survey.rows, left_out=fitted) for stream in frozen]
    if not fitted:
        for stream, check in zip(frozen, said):
            refuse(stream.file, [check])
    return _saying(kept, said)


def _once(streams: Sequence[RecordingStream]) -> list[RecordingStream]:
    """Without copies of what is fitted, the first one with what is said of them."""
    copies = fitted_twice(streams)
    kept = [stream for stream in streams if not any(stream is its for its, _ in copies)]
    return _saying(kept, [check for _, check in copies])


def _saying(streams: Sequence[RecordingStream], said: Iterable[Check]) -> list[RecordingStream]:
    """Recordings that are kept, the first one with what is said of those that are not."""
    first, *others = streams
    return [replace(first, checks=worst_first([*first.checks, *said])), *others]


def _pace(stream: RecordingStream) -> Pace:
    n, survey = len(stream.need.joints), stream.survey
    seconds = sum(segment.end - segment.start for segment in survey.segments)
    speed = (survey.highest[:n] - survey.lowest[:n]) / max(seconds, 1e-9)
    return Pace(stream.label, stream.rate_hz, speed)


def open_recording(
    study: Study, entry: RecordingEntry, need: Need, prismatic: Collection[str] = ()
) -> RecordingStream:
    """Find the columns, survey the rows. Raises RecordingError or StudyError."""
    _check_sizes(study, need)
    path = study.recording_path(entry)
    source = path if entry.table is None else entry.table
    table = one_episode(open_table(source, entry.decimal, entry.label, entry.topic), entry.episode)
    found = signal_columns(study, entry, need, table)
    names, factors, offsets = found.names, found.factors, found.offsets
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
        entry.rate_hz if found.signals[0] != "t" else None,
        window,
        stiffness,
        _NO_SURVEY,
        maps=found.maps,
    )
    seen, checks = surveyed(stream, study), []
    mended: Check | None = None
    followed: Spread | None = None
    uneven = uneven_steps(seen.excerpt, len(need.joints))
    even = "" if seen.survey.uniform else even_samples(seen.excerpt, len(need.joints))
    late = uneven or even

    def stamps() -> Iterator[np.ndarray]:
        return (b[:, 0] * factors[0] + offsets[0] for b in table.blocks(names[:1]))

    if (seen.bursts or seen.grid.rounded or late) and stream.counted_rate_hz is None:
        clock = uniform_clock(stamps, window)
        if seen.grid.holds:
            mended = rounded_stamps(stream.label, clock, seen.grid, seen.survey.rows)
        if mended is None and seen.bursts:
            followed = spread(stamps)
            followed = followed if followed and followed.is_followed(seen.excerpt, len(need.joints)) else None
        if mended is None and seen.bursts and not followed:
            mended = time_stamps(stream.label, clock, seen.bursts, seen.survey.rows)
        if mended is None and not followed and ((uneven and clock.believable) or (even and clock.unbroken)):
            mended = late_stamps(stream.label, clock, late, seen.survey.rows)
    placed = None
    if mended is None and not followed and even and stream.counted_rate_hz is None:
        placed = ticks(stamps, window)
    if followed is not None:
        checks.append(spread_stamps(stream.label, seen.bursts, seen.survey.rows))
        stream = replace(stream, spread=followed)
        seen = surveyed(stream, study)
    elif placed is not None:
        checks.append(stamps_on_ticks(stream.label, placed, even))
        stream = replace(stream, ticks=placed)
        seen = surveyed(stream, study)
    elif mended is None and late:
        checks.append((uneven_stamps if uneven else scattering_stamps)(stream.label, late))
    if mended is not None:
        checks.append(mended)
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
    if (lost := lost_rows(seen.excerpt, len(need.joints))) is not None:
        checks.append(lost.check(stream.label))
        stream = replace(stream, lost=lost)
        seen = surveyed(stream, study)
    rate_hz = stream.counted_rate_hz or seen.rate_hz
    columns = Columns(
        stream.label,
        tuple(signal for signal in found.signals if signal != "t"),
        stream.signal_joints,
        tuple(str(joint) for joint in need.joints),
        found.maps,
        need.names,
        np.array([str(joint) in prismatic for joint in need.joints]),
        study_checks.within_rates(study, rate_hz).filter.position_cutoff_hz,
        study.drive_gains == "identify",
        len(study.recordings) > 1,
    )
    survey = seen.survey
    rows = survey.rows + len(survey.mending.dropped)  # all that were read: what was lost is a share of them
    stretches = [segment.resting for segment in survey.segments]
    checks += of_table(columns, seen.mender, seen.excerpt, survey.lowest, survey.highest, rows, stretches)
    checks += more_joints(stream.label, table.columns, columns.labels)
    if table.cut:
        whole = (rows + 1, rows + 1) if window == (-np.inf, np.inf) else None
        checks.append(Check("truncated", (), table.cut, "", "mended", stream.label, whole))
    checks += seen.leaps
    refuse(stream.file, checks)
    checks += stopped_positions(columns, replace(stream, survey=survey), table, seen.excerpt)
    refuse(stream.file, checks)
    checks += velocity_agrees(columns, replace(stream, survey=survey), table)
    refuse(stream.file, checks)
    study_checks.check_rates(study, stream.label, rate_hz)
    notes = (
        *(f"{stream.label}: {text}" for text in (*table.remarks, *found.remarks)),
        *notes_on(stream.label, survey),
    )
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


_NO_SURVEY = Survey(0, 1.0, True, 0.0, 0, 0, 0, np.empty(0), np.empty(0), (), np.inf, 0)
