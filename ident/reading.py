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
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ident.errors import RecordingError, StudyError
from ident.remarks import MOVED, describe
from ident.resampling import resample
from ident.study import ColumnMap, RecordingEntry, Role, Study
from ident.tables import Table, open_table

MIN_SAMPLES = 50
COARSE_S = 0.05  # spacing of the positions by which rest is found
Block = tuple[np.ndarray, np.ndarray]  # t (N,), values (N, m): q, then motor, then sensor signals


@dataclass(frozen=True, slots=True)
class Need:
    """Which signals a model wants: motor torque, joint torque sensor; joints are numbered as in the robot
    file."""

    joints: tuple[int, ...]
    motor: bool
    sensor: bool
    model: str = "A"

    def torque(self, motor: np.ndarray | None, sensor: np.ndarray | None) -> np.ndarray:
        """The channels of the model, (N, channels): A motor, B sensor, C both, D motor - sensor (paper eq.
        7)."""
        if self.model == "C":
            assert motor is not None and sensor is not None
            return np.hstack([motor, sensor])
        if self.model == "D":
            assert motor is not None and sensor is not None
            return motor - sensor
        chosen = sensor if self.model == "B" else motor
        assert chosen is not None
        return chosen


@dataclass(frozen=True, slots=True)
class Segment:
    """One uninterrupted stretch: [start, end] of its samples, [move_start, move_end] of its motion, all s."""

    start: float
    end: float
    move_start: float
    move_end: float


@dataclass(frozen=True, slots=True)
class Survey:
    """What one pass over a recording showed."""

    rows: int
    rate_hz: float  # of the uniform samples handed on
    uniform: bool  # the table's own samples are handed on
    jitter_rms_s: float
    same_stamp_rows: int
    repeated_rows: int
    held_position_rows: int
    lowest: np.ndarray  # (m,)
    highest: np.ndarray
    segments: tuple[Segment, ...]
    gap_s: float  # intervals longer than this split
    missing_rows: int  # shorter holes that interpolation crosses


@dataclass(frozen=True, slots=True)
class Recording:
    """One segment held whole: t (N,) [s] uniform, q (N, n) [rad|m], torques (N, n) [N m|N] or None.

    tau_m is in drive units where the drive gains are identified. label is unique in a study; index counts the
    segments of one file.
    """

    label: str
    role: Role
    payload: str | None
    t: np.ndarray
    q: np.ndarray
    dq_measured: np.ndarray | None
    tau_m: np.ndarray | None
    tau_l: np.ndarray | None
    rate_hz: float
    index: int = 0
    move_start: float = -np.inf
    move_end: float = np.inf
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RecordingStream:
    """A surveyed recording; nothing of its samples is held."""

    label: str
    role: Role
    payload: str | None
    file: str
    need: Need
    table: Table
    names: tuple[str, ...]  # columns of the table: t (unless counted), q, motor, sensor
    factors: np.ndarray  # (columns,)
    offsets: np.ndarray
    counted_rate_hz: float | None  # t is the row number over this where the table has no time
    window: tuple[float, float]
    stiffness: np.ndarray | None  # (n,) when positions are the joints'
    survey: Survey
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def rate_hz(self) -> float:
        return self.survey.rate_hz

    def segments(self) -> Iterator[tuple[Segment, Iterator[np.ndarray]]]:
        """Segments in order; each with blocks (N, m) of uniform samples, to be used up before the next
        one."""
        pieces = _Pieces(_clean(self, self.survey.gap_s, drop_repeats=not self.survey.uniform))
        for segment in self.survey.segments:
            blocks = pieces.take(segment.start, segment.end)
            yield (
                segment,
                (values for _, values in blocks) if self.survey.uniform else resample(blocks, self.rate_hz),
            )

    def split(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
        """Columns of a block (N, m) -> q, motor signal, sensor signal, each (N, n) or None."""
        n = len(self.need.joints)
        motor = values[:, n : 2 * n] if self.need.motor else None
        sensor = values[:, -n:] if self.need.sensor else None
        return values[:, :n], motor, sensor

    def load(self) -> list[Recording]:
        """The whole recording in memory, one value per segment."""
        out = []
        for index, (segment, blocks) in enumerate(self.segments()):
            values = np.concatenate(list(blocks))
            q, motor, sensor = self.split(values)
            out.append(
                Recording(
                    self.label,
                    self.role,
                    self.payload,
                    segment.start + np.arange(len(q)) / self.rate_hz,
                    q,
                    None,
                    motor,
                    sensor,
                    self.rate_hz,
                    index,
                    segment.move_start,
                    segment.move_end,
                    self.notes,
                )
            )
        return out


def need_of(model: str, channels: tuple[str, ...], positions: str = "motor") -> Need:
    """The signals that a model's channels need; joint numbers come from the channel names (tau_m3 -> 3)."""
    numbers = [int(name.lstrip("tau_mlrd")) for name in channels]
    joints = tuple(dict.fromkeys(numbers))
    return Need(joints, motor=model in "ACD", sensor=model in "BCD" or positions == "joint", model=model)


def open_recordings(study: Study, need: Need) -> list[RecordingStream]:
    """Open and survey every recording of a study, in its order."""
    return [open_recording(study, entry, need) for entry in study.recordings]


def open_recording(study: Study, entry: RecordingEntry, need: Need) -> RecordingStream:
    """Find the columns, survey the rows. Raises RecordingError or StudyError."""
    _check_sizes(study, need)
    path = study.recording_path(entry)
    table = open_table(path, entry.decimal)
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
        currents = all(has(f"i{j}") for j in need.joints)
        for k, j in enumerate(need.joints):
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
        for j in need.joints:
            add(f"tau_l{j}")
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


def _raw(stream: RecordingStream) -> Iterator[Block]:
    """SI blocks (t, values) inside the window, checked for finite values."""
    row = 0
    for block in stream.table.blocks(stream.names):
        values = block * stream.factors + stream.offsets
        if stream.counted_rate_hz is not None:
            t = np.arange(row, row + len(values)) / stream.counted_rate_hz
        else:
            t, values = values[:, 0], values[:, 1:]
        inside = (t >= stream.window[0]) & (t < stream.window[1]) | ~np.isfinite(t)
        if not np.isfinite(block).all() and not np.isfinite(block[inside]).all():
            bad_row, bad_column = np.argwhere(~np.isfinite(block) & inside[:, None])[0]
            raise RecordingError(
                stream.file,
                f"column {stream.names[bad_column]} is not a finite number in row "
                f"{row + bad_row + 1}; repair it, or leave it out with from: and to:",
            )
        row += len(block)
        if stream.stiffness is not None:  # Appendix 2: q - tau_l / k
            n = len(stream.need.joints)
            values = values.copy()
            values[:, :n] -= values[:, -n:] / stream.stiffness
        if inside.all():
            yield t, values
        elif inside.any():
            yield t[inside], values[inside]


def _clean(stream: RecordingStream, gap_s: float, drop_repeats: bool) -> Iterator[Block]:
    """Blocks without rows whose stamp repeats and, where asked, without rows that repeat the one before
    them."""
    last_t, last_row = None, None
    for t, values in _raw(stream):
        dt = np.diff(t, prepend=t[0] - 1.0 if last_t is None else last_t)
        keep = dt > 0
        if drop_repeats:
            before = np.vstack([values[:1] + 1.0 if last_row is None else last_row, values[:-1]])
            keep &= ~_single_repeats((values == before).all(axis=1))
        last_t, last_row = t[-1], values[-1]
        if keep.any():
            yield t[keep], values[keep]


def _single_repeats(same: np.ndarray) -> np.ndarray:
    """Runs of at most two repeated rows: a state read again. Longer runs are rest."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.view(np.int8), [0]])))
    out = np.zeros(len(same), bool)
    for start, end in edges.reshape(-1, 2):
        if end - start <= 2:
            out[start:end] = True
    return out


class _Pieces:
    """Deals a stream of blocks out to segments by their end times."""

    def __init__(self, blocks: Iterator[Block]) -> None:
        self.blocks = blocks
        self.rest: Block | None = None

    def take(self, start: float, end: float) -> Iterator[Block]:
        """Blocks with start <= t <= end; rows before start (stretches too short to use) are passed over."""
        while True:
            block = self.rest if self.rest is not None else next(self.blocks, None)
            self.rest = None
            if block is None:
                return
            t, values = block
            skip = int(np.searchsorted(t, start))
            t, values = t[skip:], values[skip:]
            count = int(np.searchsorted(t, end, side="right"))
            if count < len(t):
                self.rest = (t[count:], values[count:])
                if count:
                    yield t[:count], values[:count]
                return
            if count:
                yield t, values


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
    for t, values in _raw(stream):
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
        repeated += int(_single_repeats(same & moving).sum())
        held += int(_single_repeats((after[:, :n] == before[:, :n]).all(axis=1) & ~same).sum())
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
