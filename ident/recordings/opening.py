"""Recordings: from somebody's table to uniform samples in SI units, and what was done to get there.

`open_recordings(study, joints, need)` opens every recording of a study and surveys it once (time stamps,
gaps, repeats, rest, units). `RecordingStream.segments()` then yields its uninterrupted stretches as blocks
of uniform samples, however long the log is; `RecordingStream.load()` holds them whole as `Recording` values.

What is refused: time that runs backwards, values that are not finite, a missing column, fewer than
`MIN_SAMPLES` samples. What is mended and said (`notes`, `warnings`): rows whose time stamp repeats, rows that
repeat the previous one (the same state read twice: dropped where single, so that motion is interpolated
across them), jitter (resampled), gaps (the recording is split, never bridged), rest at both ends (not
fitted).
"""

from __future__ import annotations

import difflib
from dataclasses import replace

import numpy as np

from ident.errors import RecordingError, StudyError
from ident.recordings.need import Need as Need
from ident.recordings.need import need_of as need_of
from ident.recordings.recording import (
    MIN_SAMPLES,
    RecordingStream,
    Segment,
    Survey,
    raw_blocks,
    single_repeats,
)
from ident.recordings.remarks import MOVED, describe
from ident.recordings.study import ColumnMap, RecordingEntry, Study
from ident.recordings.tables import Table, open_table

COARSE_S = 0.05  # spacing of the positions by which rest is found


def open_recordings(study: Study, need: Need) -> list[RecordingStream]:
    """Open and survey every recording of a study, in its order."""
    return [open_recording(study, entry, need) for entry in study.recordings]


def open_recording(study: Study, entry: RecordingEntry, need: Need) -> RecordingStream:
    """Find the columns, survey the rows. Raises RecordingError or StudyError."""
    _check_sizes(study, need)
    path = study.recording_path(entry)
    table = open_table(path if entry.table is None else entry.table, entry.decimal, entry.label)
    names, factors, offsets, notes = _columns(study, entry, need, table)
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
        entry.rate_hz if "t" not in notes else None,
        window,
        stiffness,
        _NO_SURVEY,
    )
    survey = _survey(stream, study)
    said, warnings = describe(stream, survey)
    return replace(stream, survey=survey, notes=said, warnings=warnings)


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
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, set[str]]:
    """The table's columns for t, q, motor, sensor with their factors and offsets."""
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
    found: set[str] = set()

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
        found.add(signal)

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
    return tuple(names), np.array(factors), np.array(offsets), found


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


def _survey(stream: RecordingStream, study: Study) -> Survey:
    """One pass: intervals, gaps, repeats, extremes, and when the motion begins and ends."""
    settings = study.filter
    n = len(stream.need.joints)
    rows = same_stamp = repeated = held = missing = 0
    first_interval, gap_s = 0.0, np.inf
    lowest = highest = np.empty(0)
    last_t: float | None = None
    last_row = np.empty(0)
    sums = np.zeros(3)  # intervals inside segments: count, sum, sum of squares about the median
    worst = 0.0
    marks: list[tuple[float, float]] = []  # gaps
    coarse_t: list[np.ndarray] = []
    coarse_q: list[np.ndarray] = []
    begin = None
    for t, values in raw_blocks(stream):
        if begin is None:
            begin = float(t[0])
            lowest, highest = values.min(axis=0), values.max(axis=0)
            intervals = np.diff(t)
            positive = intervals[intervals > 0]
            if (intervals < 0).any() or not len(positive):
                _refuse_time(stream, t[1:], intervals, rows + 1)
            first_interval = float(np.median(positive))
            gap_s = max(5 * first_interval, 0.15 / settings.position_cutoff_hz)
            dt, before = intervals, values[:-1]
            after, after_t = values[1:], t[1:]
        else:
            dt = np.diff(t, prepend=float(last_t or 0.0))
            before, after, after_t = np.vstack([last_row, values[:-1]]), values, t
        if (dt < 0).any():
            _refuse_time(stream, after_t, dt, rows)
        rows += len(t)
        same = (after == before).all(axis=1)
        moving = dt > 0
        same_stamp += int((~moving).sum())
        repeated += int(single_repeats(same & moving).sum())
        held += int(single_repeats((after[:, :n] == before[:, :n]).all(axis=1) & ~same).sum())
        wide = dt > gap_s
        marks += [(float(after_t[k] - dt[k]), float(after_t[k])) for k in np.flatnonzero(wide)]
        inner = dt[moving & ~wide]
        sums += [len(inner), inner.sum(), ((inner - first_interval) ** 2).sum()]
        worst = max(worst, float(np.abs(inner - first_interval).max(initial=0.0)))
        missing += int(np.maximum(np.rint(inner / first_interval) - 1, 0).sum())
        lowest, highest = np.minimum(lowest, values.min(axis=0)), np.maximum(highest, values.max(axis=0))
        picks = _every(t, COARSE_S, coarse_t[-1][-1] if coarse_t else -np.inf)
        if len(picks):
            coarse_t.append(t[picks])
            coarse_q.append(values[picks, :n])
        last_t, last_row = float(t[-1]), values[-1]
    if begin is None or last_t is None:
        raise RecordingError(
            stream.file, "holds no rows between from and to; correct the window in the study"
        )
    if rows < MIN_SAMPLES:
        raise RecordingError(
            stream.file,
            f"holds only {rows} samples, at least {MIN_SAMPLES} are needed; record longer or widen from/to",
        )
    mean = sums[1] / max(sums[0], 1)
    uniform = worst < 0.02 * first_interval and same_stamp == 0 and settings.resample_hz is None
    uniform = uniform and repeated < 0.001 * rows
    jitter = float(np.sqrt(sums[2] / max(sums[0], 1)))
    rate = 1.0 / mean if uniform else settings.resample_hz or _round_rate(1.0 / first_interval)
    edges = [begin, *[edge for mark in marks for edge in mark], last_t]
    segments = _segments(edges, np.concatenate(coarse_t), np.concatenate(coarse_q), study.trim_rest, rate)
    if not segments:
        raise RecordingError(
            stream.file, "has no stretch without gaps that is long enough to filter; record again"
        )
    return Survey(
        rows, rate, uniform, jitter, same_stamp, repeated, held, lowest, highest, segments, gap_s, missing
    )


def _refuse_time(stream: RecordingStream, t: np.ndarray, dt: np.ndarray, row: int) -> None:
    if not (dt < 0).any():
        raise RecordingError(
            stream.file, "the time column does not advance; map the right column with columns: {t: ...}"
        )
    k = int(np.argmax(dt < 0))
    at = float(t[k])
    raise RecordingError(
        stream.file,
        f"time runs backwards near row {row + k + 1} (at {at:g} s); sort the rows, or "
        "split the file where the clock was reset",
    )


def _round_rate(rate: float) -> float:
    """A measured rate to three digits: 1010.1 Hz of jittered stamps is 1010 Hz."""
    return float(f"{rate:.3g}")


def _every(t: np.ndarray, spacing: float, last: float) -> np.ndarray:
    slots = np.floor(t / spacing)
    new = np.diff(slots, prepend=np.floor(last / spacing) if np.isfinite(last) else slots[0] - 1) > 0
    return np.flatnonzero(new)


def _segments(
    edges: list[float], t: np.ndarray, q: np.ndarray, trim: bool, rate: float
) -> tuple[Segment, ...]:
    """Segments between gaps, at least MIN_SAMPLES long, with the times at which motion begins and ends."""
    out = []
    for start, end in zip(edges[::2], edges[1::2]):
        if (end - start) * rate < MIN_SAMPLES:
            continue
        inside = (t >= start) & (t <= end)
        move_start, move_end = start, end
        if trim and inside.sum() > 2:
            times, positions = t[inside], q[inside]
            away = np.flatnonzero((np.abs(positions - positions[0]) > MOVED).any(axis=1))
            back = np.flatnonzero((np.abs(positions - positions[-1]) > MOVED).any(axis=1))
            if len(away) and len(back):
                move_start = float(times[max(away[0] - 1, 0)]) if away[0] > 1 else start
                move_end = (
                    float(times[min(back[-1] + 1, len(times) - 1)]) if back[-1] < len(times) - 2 else end
                )
        out.append(Segment(start, end, move_start, move_end))
    return tuple(out)


_NO_SURVEY = Survey(0, 1.0, True, 0.0, 0, 0, 0, np.empty(0), np.empty(0), (), np.inf, 0)
