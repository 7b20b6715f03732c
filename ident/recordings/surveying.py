"""One pass over a recording: its clock, its gaps, what of it is no measurement, when it moves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ident.errors import RecordingError
from ident.examination.check import Check, listed, refuse
from ident.examination.tables.clock import BURSTS, SIDE, Grid, clock_leap, goes_on, time_unit
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.mending import Mender
from ident.examination.tables.signals import MOVED
from ident.recordings.recording import (
    MIN_SAMPLES,
    RecordingStream,
    Segment,
    Survey,
    raw_blocks,
    single_repeats,
)
from ident.recordings.study import Study

COARSE_S = 0.05  # spacing of the positions by which rest is found


@dataclass(frozen=True, slots=True)
class Surveyed:
    """What one pass showed; `bursts` rows share a stamp or follow in a burst, 0 where they are few."""

    survey: Survey
    mender: Mender
    excerpt: Excerpt
    bursts: int
    rate_hz: float  # as recorded, where the stamps are to be believed
    grid: Grid
    leaps: tuple[Check, ...]  # of the clock


def surveyed(stream: RecordingStream, study: Study) -> Surveyed:
    """One pass: intervals, gaps, repeats, extremes, lost samples, when the motion begins and ends.

    Raises RecordingError for what is no time at all, and where nothing is left.
    """
    mender = Mender(
        len(stream.need.joints),
        stream.factors[-len(stream.signal_joints) :],
        stream.offsets[-len(stream.signal_joints) :],
    )
    excerpt, bursts, grid = Excerpt(), 0, Grid()
    settings = study.filter
    n = len(stream.need.joints)
    rows = same_stamp = repeated = held = missing = 0
    first_interval, gap_s = 0.0, np.inf
    lowest = highest = np.empty(0)
    last_t: float | None = None
    last_row = np.empty(0)
    recent: tuple[np.ndarray, ...] = (np.empty(0), np.empty((0, n)))  # stamps, positions before a block
    leaps = []
    sums = np.zeros(3)  # intervals inside segments: count, sum, sum of squares about the median
    worst = 0.0
    marks: list[tuple[float, float]] = []  # gaps
    coarse_t: list[np.ndarray] = []
    coarse_q: list[np.ndarray] = []
    begin = None
    for block in mender.run(_timed(stream, study)):
        numbers, t, values = block
        if not len(t):
            continue
        excerpt.take(block)
        if begin is None:
            begin = float(t[0])
            lowest, highest = values.min(axis=0), values.max(axis=0)
            intervals = np.diff(t)
            positive = intervals[intervals > 0]
            if (intervals < 0).any() or not len(positive):
                _refuse_time(stream, t[1:], intervals, numbers[1:])
            first_interval = float(np.median(positive))
            gap_s = max(5 * first_interval, 0.15 / settings.position_cutoff_hz)
            dt, before = intervals, values[:-1]
            after, after_t, at = values[1:], t[1:], numbers[1:]
        else:
            dt = np.diff(t, prepend=float(last_t or 0.0))
            before, after, after_t, at = np.vstack([last_row, values[:-1]]), values, t, numbers
        if (dt < 0).any():
            _refuse_time(stream, after_t, dt, at)
        rows += len(t)
        grid.take(dt)
        same = (after == before).all(axis=1)
        moving = dt > 0
        same_stamp += int((~moving).sum())
        repeated += int(single_repeats(same & moving).sum())
        held += int(single_repeats((after[:, :n] == before[:, :n]).all(axis=1) & ~same).sum())
        wide = dt > gap_s
        bursts += int(((dt < 0.3 * dt[~wide].sum() / max((~wide).sum(), 1)) & ~same).sum())
        marks += [(float(after_t[k] - dt[k]), float(after_t[k])) for k in np.flatnonzero(wide)]
        for k in np.flatnonzero(wide):
            first = len(values) - len(after) + k  # of the rows after the gap
            near = slice(max(first - SIDE, 0), first), slice(first, first + SIDE)
            stamps, sides = (
                (np.concatenate([past, now[near[0]]])[-SIDE:], now[near[1]])
                for past, now in zip(recent, (t, values[:, :n]))
            )
            if goes_on(sides, stamps, first_interval):
                leaps.append(clock_leap(stream.label, float(dt[k]), int(at[k]) + 1))
        recent = tuple(np.concatenate([past, now])[-SIDE:] for past, now in zip(recent, (t, values[:, :n])))
        inner = dt[moving & ~wide]
        sums += [len(inner), inner.sum(), ((inner - first_interval) ** 2).sum()]
        worst = max(worst, float(np.abs(inner - first_interval).max(initial=0.0)))
        missing += int(np.maximum(np.rint(inner / first_interval) - 1, 0).sum())
        lowest, highest = np.minimum(lowest, values.min(axis=0)), np.maximum(highest, values.max(axis=0))
        picks = _every(t, COARSE_S, coarse_t[-1][-1] if coarse_t else -np.inf)
        if len(picks):
            coarse_t.append(t[picks])
            coarse_q.append(values[picks, :n].astype(np.float32))
        last_t, last_row = float(t[-1]), values[-1]
    if begin is None or last_t is None:
        raise RecordingError(
            stream.file,
            "holds no row with a value in every column that is needed"
            f"{_empty(stream, mender) or _whole(stream)}; map other columns with columns: {{...}}, or "
            "correct the window",
        )
    if rows < MIN_SAMPLES:
        frozen = sum(int(its.max()) for kind, its in mender.counts.items() if kind in ("frozen", "ended"))
        beside = f" beside {frozen} that are frozen, in which nothing at all changes" if frozen else ""
        empty = len(mender.mending().dropped) - frozen  # for so long that nothing says where the joint was
        beside += f" beside {empty} in which a position has no value" if empty > 0 else ""
        raise RecordingError(
            stream.file,
            f"holds only {rows} samples{beside}{_whole(stream)}, at least {MIN_SAMPLES} are needed; record "
            "longer or widen from/to",
        )
    mean = sums[1] / max(sums[0], 1)
    uniform = worst < 0.02 * first_interval and same_stamp == 0 and settings.resample_hz is None
    uniform = uniform and repeated < 0.001 * rows
    jitter = float(np.sqrt(sums[2] / max(sums[0], 1)))
    rate = 1.0 / mean if uniform else settings.resample_hz or _round_rate(1.0 / first_interval)
    marks = sorted(marks + mender.gaps)
    edges = [begin, *[edge for mark in marks for edge in mark], last_t]
    often = (rows - 1) / max(last_t - begin, first_interval) if 2 * same_stamp > rows else rate
    segments = _segments(edges, np.concatenate(coarse_t), np.concatenate(coarse_q), study.trim_rest, often)
    if not segments:
        raise RecordingError(
            stream.file, "has no stretch without gaps that is long enough to filter; record again"
        )
    survey = Survey(
        rows,
        rate,
        uniform,
        jitter,
        same_stamp,
        repeated,
        held,
        lowest,
        highest,
        segments,
        gap_s,
        missing,
        mender.mending(),
    )
    return Surveyed(
        survey,
        mender,
        excerpt,
        bursts if bursts > BURSTS * rows else 0,
        1.0 / first_interval,
        grid,
        tuple(leaps),
    )


def _timed(stream: RecordingStream, study: Study) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The raw blocks, once their time is in seconds. Raises RecordingError where it is not."""
    if stream.counted_rate_hz is None:
        stamps = next(iter(stream.table.blocks(stream.names[:1])), np.zeros((0, 1)))[:, 0]
        seconds = stamps * stream.factors[0] + stream.offsets[0]
        with np.errstate(invalid="ignore"):  # stamps may be infinite
            steps = np.diff(seconds)
        if (steps < 0).any():
            _refuse_time(stream, seconds[1:], steps, np.arange(1, len(seconds)))
        if (steps > 0).any():
            own = [e.columns for e in study.recordings if e.label == stream.label]  # none: a log to predict
            maps = {**study.columns, **(own[0] if own else {})}
            check = time_unit(stream.label, _step(steps), maps, len(study.recordings) > 1)
            refuse(stream.file, [check] if check else [])
    yield from raw_blocks(stream)


def _step(steps: np.ndarray) -> float:
    """From one sample to the next as stamps tell it: the usual step, or the mean where most rows share a
    stamp, whose steps are what it resolves. (Of a Franka's in whole seconds milliseconds were told.)"""
    known = steps[np.isfinite(steps)]
    own = known[known > 0]
    return float(np.median(own) if 2 * len(own) > len(known) else known.mean())


def _refuse_time(stream: RecordingStream, t: np.ndarray, dt: np.ndarray, rows: np.ndarray) -> None:
    if not (dt < 0).any():
        raise RecordingError(
            stream.file,
            "the time column does not advance: another column, or stamps that "
            "were stored with too few digits, as seconds since 1970 are in single precision; map the right "
            "column with columns: {t: ...}, or leave t out and give rate_hz: beside the file",
        )
    k = int(np.argmax(dt < 0))
    at = float(t[k])
    raise RecordingError(
        stream.file,
        f"time runs backwards near row {rows[k] + 1} (at {at:g} s); sort the rows, or "
        "split the file where the clock was reset",
    )


def _round_rate(rate: float) -> float:
    """A measured rate to three digits: 1010.1 Hz of jittered stamps is 1010 Hz."""
    return float(f"{rate:.3g}")


def _empty(stream: RecordingStream, mender: Mender) -> str:
    """Columns without any value, in words."""
    missing = mender.counts.get("missing_values", np.zeros(0, int))
    names = stream.names[len(stream.names) - len(missing) :]  # the first one is the time, if there is one
    empty = [name for name, count in zip(names, missing) if count == missing.max()]
    return f" ({listed(empty)} {'is' if len(empty) == 1 else 'are'} empty)" if empty else ""


def _whole(stream: RecordingStream) -> str:
    """What a window is a part of, in words. (Of 5 kHz in ms, which 0.2 s apart could be, 3 s are 14 rows.)"""
    if stream.window == (-np.inf, np.inf):
        return ""
    whole = [t for _, t, _ in raw_blocks(replace(stream, window=(-np.inf, np.inf)))]
    if not whole:
        return ""
    low, high, step = whole[0][0], whole[-1][-1], float(np.median(np.diff(whole[0])))
    return f" between from and to [s], while its t goes from {low:g} to {high:g} in steps of {step:g}"


def _every(t: np.ndarray, spacing: float, last: float) -> np.ndarray:
    slots = np.floor(t / spacing)
    new = np.diff(slots, prepend=np.floor(last / spacing) if np.isfinite(last) else slots[0] - 1) > 0
    return np.flatnonzero(new)


def _away(positions: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Rows of positions (N, n) that are elsewhere; joint by joint, as a night of them is large."""
    out = np.zeros(len(positions), bool)
    for joint, its in zip(positions.T, place):
        out |= np.abs(joint - its) > MOVED
    return np.flatnonzero(out)


def _segments(
    edges: list[float], t: np.ndarray, q: np.ndarray, trim: bool, rate: float
) -> tuple[Segment, ...]:
    """Segments between gaps, at least MIN_SAMPLES long, with the times at which motion begins and ends."""
    out = []
    for start, end in zip(edges[::2], edges[1::2]):
        if (end - start) * rate < MIN_SAMPLES:
            continue
        inside = slice(np.searchsorted(t, start), np.searchsorted(t, end, side="right"))
        times, positions = t[inside], q[inside]
        move_start, move_end = start, end
        if trim and len(times) > 2:
            away, back = _away(positions, positions[0]), _away(positions, positions[-1])
            if len(away) and len(back):
                move_start = float(times[max(away[0] - 1, 0)]) if away[0] > 1 else start
                move_end = (
                    float(times[min(back[-1] + 1, len(times) - 1)]) if back[-1] < len(times) - 2 else end
                )
        still: list[int] = []  # of a stretch of a tenth of a second nobody knows
        if len(times) > 2:
            still = np.flatnonzero(np.ptp(positions, axis=0) < MOVED).tolist()
        out.append(Segment(start, end, move_start, move_end, tuple(still)))
    return tuple(out)
