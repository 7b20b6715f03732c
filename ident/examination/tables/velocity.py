"""Whether the logged velocity is the derivative of the logged position: clock, degrees, motor side.

The velocity is not needed by any fit; as a second witness of the clock and of the positions' unit it is worth
much. Both are compared after the same low-pass filter, at the lag (up to 50 ms) at which they agree best,
because most controllers filter the velocity they log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.tables.late_positions import lag_of, late_positions
from ident.examination.tables.signals import Columns
from ident.examination.tables.spikes import no_measurement

if TYPE_CHECKING:
    from ident.recordings.recording import RecordingStream
    from ident.recordings.tables import Table

ROWS = 40000
SLIGHT = (
    0.02  # disagreement that is said, where it is more than what the filter of a logged velocity leaves out
)
WRONG = 0.25  # that is refused
ALIKE = 0.9  # correlation from which two signals are the same but for a factor
UNLIKE = 0.5
ABOVE_NOISE = 5.0  # what a signal changes in a cell of the comparison
LAG_S = 0.05
DEGREE = 180 / np.pi
NEAR_DEGREES, NEAR = 0.05, 0.01
ANOTHERS = " another joint's, signal's or run's, or is spoilt (held, smoothed over its wraps)"
UNITS = {  # of velocities, by what they are times the derivative of positions
    30 / np.pi: "in rpm",
    60.0: "in rpm, of positions in turns",
    1 / 6: "in rpm, of positions in degrees",
    0.5 / np.pi: "in turns a second",
    1 / 360: "in turns a second, of positions in degrees",
}


def velocity_agrees(columns: Columns, stream: RecordingStream, table: Table) -> Iterator[Check]:
    """Regression of dq on the derivative of q, joint by joint."""
    has = logged_velocities(columns.labels, columns.maps, table)
    if not has or stream.stiffness is not None:
        return
    found, lags = {}, {}
    t, q, dq = _read(columns, stream, table, has)
    for k, j in enumerate(has):
        fit = slope(t, q[:, k], dq[:, k])
        if fit is not None:
            found[j] = fit
        if (lag := lag_of(t, q[:, k], dq[:, k])) is not None:
            lags[j] = lag
    yield from late_positions(columns, lags)
    yield from _judged(columns, found, lambda j: _rivals(j, list(has), t, q, dq))


def logged_velocities(
    labels: Sequence[str], maps: Mapping[str, Any], table: Table
) -> dict[str, tuple[str, float, float]]:
    """joint -> column, factor and offset of its velocity, of those that the table holds."""
    has = {}
    for j in labels:
        known = maps.get(f"dq{j}")
        where = known.column if known is not None else f"dq{j}"
        where = table.columns[where] if isinstance(where, int) and where < len(table.columns) else where
        if where in table.columns:
            has[j] = (where, known.scale * known.sign if known else 1.0, known.offset if known else 0.0)
    return has


def _rivals(
    joint: str, joints: Sequence[str], t: np.ndarray, q: np.ndarray, dq: np.ndarray
) -> Iterator[tuple[float, str]]:
    """What a joint's velocity may be but a factor of its own derivative, each as it is: the share of the
    velocity that it leaves, and words. q and dq (N, k) of the joints."""
    own = joints.index(joint)
    for k, other in enumerate(joints):
        fit = slope(t, q[:, k], dq[:, own], unsigned=k == own)
        if fit is not None:
            words = "its magnitude" if k == own else f"the derivative of q{other}"
            yield _left(*fit), words


def _left(slope: float, correlation: float) -> float:
    """What a derivative as it is, not times the slope, leaves of a velocity, a share of it."""
    return float(np.sqrt(max(1 - correlation**2 * (2 - 1 / slope) / slope, 0.0)))


def _judged(
    columns: Columns,
    found: dict[str, tuple[float, float]],
    rivals: Callable[[str], Iterable[tuple[float, str]]],
) -> Iterator[Check]:
    """found: joint -> slope, correlation; rivals: of a joint, what its velocity may be in their place."""
    alike = {j: s for j, (s, r) in found.items() if abs(r) > ALIKE}
    wrong = {j: s for j, s in alike.items() if abs(s - 1) > WRONG}
    strangers = {j: "" for j, (_, r) in found.items() if abs(r) < UNLIKE}
    as_well = {}  # what may be as well as a factor
    for j in (*wrong, *strangers):
        left, words = min(rivals(j), default=(np.inf, ""))
        own = np.sqrt(1 - min(found[j][1] ** 2, 1.0))
        if left < own - SLIGHT:
            strangers[j] = words
        elif left < own + SLIGHT and j in wrong:
            as_well[j] = words
    if any(strangers.values()):  # one cause of them all
        strangers |= as_well
    strangers = {j: strangers[j] for j in found if j in strangers}
    wrong, alike = ({j: s for j, s in its.items() if j not in strangers} for its in (wrong, alike))
    slight = [
        j
        for j, s in alike.items()
        if max(SLIGHT, np.sqrt(1 - min(found[j][1] ** 2, 1.0))) < abs(s - 1) <= WRONG
    ]
    degrees, others = _in_degrees(columns, wrong)
    yield from _degrees(columns, degrees, whole=len(degrees) == len(alike))
    if others:
        yield _another_rate(columns, others, as_well, together=len(others) == len(alike))
    if slight:
        text = ", ".join(f"dq{j} {alike[j]:.3f}" for j in slight)
        factor = float(np.median([alike[j] for j in slight]))
        spread = float(np.ptp([alike[j] for j in slight]))
        one = len(slight) == len(alike) > 1 and spread < 0.2 * abs(factor - 1)
        clock = columns.line({"t": {"scale": float(f"{1 / factor:.4g}")}})
        yield Check(
            "clock_rate",
            tuple(f"dq{j}" for j in slight),
            f"logged velocities differ from the derivative of the positions (factor: {text})"
            + one * ", all alike: the clock is wrong, or they are",
            f"if it is the clock, write {clock}"
            if one
            else "nothing here uses them; check where they come from",
            recording=columns.recording,
            open=one,
        )
    if strangers:
        yield _strangers(columns, strangers, [abs(found[j][1]) for j in strangers])


def _strangers(columns: Columns, strangers: Mapping[str, str], correlations: Sequence[float]) -> Check:
    """strangers: joint -> what its velocity goes as in the place of its own derivative, if anything."""
    names = tuple(f"dq{j}" for j in strangers)
    least = min(correlations)
    unlike = f" (correlation {least:.2f})" if least < UNLIKE else ""
    known = {
        words: [f"dq{j}" for j, its in strangers.items() if its == words] for words in strangers.values()
    }
    known.pop("", None)
    looks = ", ".join(f"{listed(its)} {'goes' if len(its) == 1 else 'go'} as {w}" for w, its in known.items())
    return Check(
        "clock_rate",
        (*names, *(f"q{j}" for j, what in strangers.items() if not what)),  # which may be another signal
        f"{listed(names)} {'is' if len(names) == 1 else 'are'} not the derivative of "
        f"{listed('q' + j for j in strangers)}{unlike}: "
        f"{looks or 'one of the two is' + ANOTHERS}",
        "check the columns, and look at the plot of both",
        recording=columns.recording,
    )


def _in_degrees(columns: Columns, wrong: dict[str, float]) -> tuple[dict[str, float], dict[str, float]]:
    """Turning joints whose velocity is 57.3 times the derivative of the position, or that part of it: one of
    the two is in degrees; and the others. joint -> slope."""
    turning = {j for j, straight in zip(columns.labels, columns.prismatic) if not straight}
    degrees = {
        j: s
        for j, s in wrong.items()
        if j in turning
        and min(abs(s / DEGREE - 1), abs(s * DEGREE - 1)) < NEAR_DEGREES
        and not (_unit(s) and abs(s / DEGREE - 1) > NEAR)
    }
    return degrees, {j: s for j, s in wrong.items() if j not in degrees}


def _degrees(columns: Columns, found: dict[str, float], whole: bool) -> Iterator[Check]:
    """found: joint -> slope, those of degrees; whole: every joint that moves is one of them, and what rests
    is read from the same log."""
    for signal, its in (
        ("q", {j: s for j, s in found.items() if s < 1}),
        ("dq", {j: s for j, s in found.items() if s > 1}),
    ):
        if not its:
            continue
        everywhere = whole and len(its) == len(found)
        turning = [j for j, straight in zip(columns.labels, columns.prismatic) if not straight]
        joints = turning if everywhere and signal == "q" else list(its)
        plain = "positions" if signal == "q" else "velocities"
        subject, of, which = "the logged velocities", "the positions", f"the {plain}"
        if not everywhere:
            subject, of, which = (listed(f"{name}{j}" for j in its) for name in ("dq", "q", signal))
        verb = "are" if everywhere or len(its) > 1 else "is"
        factor = float(np.median(list(its.values())))
        scales = {f"{signal}{j}": {"scale": 0.0174533} for j in joints}
        message = f"{subject} {verb} {factor:.4g} times the derivative of {of}: {which} {verb} in degrees"
        remedy = f"write {columns.line(scales)}"
        others = [f"{'dq' if signal == 'q' else 'q'}{j}" for j in its]
        read = [columns.maps[name].scale for name in others if name in columns.maps]
        if len(read) == len(others) and all(abs(DEGREE * scale - 1) < NEAR for scale in read):
            unit = "rad/s" if signal == "q" else "rad"
            message += f", or {listed(others)} {verb} in {unit} and {verb} read as degrees"
            remedy += f", or {columns.line({name: {'scale': DEGREE} for name in others})} where it is that"
        yield Check(
            "angle_unit" if signal == "q" else "clock_rate",
            ("t", *(f"dq{j}" for j in its)) if signal == "dq" else tuple(scales),
            message,
            remedy,
            outcome="refused",
            recording=columns.recording,
        )


def _unit(factor: float) -> str:
    """The unit of velocities that are this much times the derivative of positions in rad, if it is one."""
    return next((name for size, name in UNITS.items() if abs(factor / size - 1) < NEAR), "")


def _another_rate(
    columns: Columns, wrong: dict[str, float], as_well: Mapping[str, str], together: bool
) -> Check:
    """wrong: joint -> slope; as_well: what its velocity may be; together: no joint that moves agrees with
    its velocity."""
    values = np.array(list(wrong.values()))
    factor = float(np.median(values))
    names = tuple(f"dq{j}" for j in wrong)
    repair = columns.line({f"dq{j}": {"scale": float(f"{1 / s:.6g}")} for j, s in wrong.items()})
    if factor < 0 or not (together and np.ptp(values) < 0.1 * abs(factor)):
        text = ", ".join(f"{s:.4g}" for s in values)
        why = "another sign" if factor < 0 else "another unit, or the motor's side of the gear"
        message = f"{listed(names)}: {text} times the derivative of the positions ({why})"
        message += "".join(f", or dq{j} is {words}" for j, words in as_well.items() if j in wrong)
        remedy = f"write {repair}, or give the positions the scale or sign that makes them agree"
    else:
        unit = _unit(factor) if len(wrong) > 1 else ""
        message = (
            f"the logged velocities are {factor:.4g} times the derivative of the positions over t on "
            f"{'every joint' if len(wrong) > 1 else 'joint ' + next(iter(wrong))}: the clock runs "
            f"{max(factor, 1 / factor):.3g} times too {'slow' if factor < 1 else 'fast'}, or the "
            f"velocities have another unit{unit and f': they look {unit}'}"
        )
        clock = columns.line({"t": {"scale": float(f"{1 / factor:.6g}")}})
        remedy = f"write {clock} where t is wrong, {repair} where the velocities are"
    return Check("clock_rate", ("t", *names), message, remedy, outcome="refused", recording=columns.recording)


def slope(t: np.ndarray, q: np.ndarray, dq: np.ndarray, unsigned: bool = False) -> tuple[float, float] | None:
    """(dq over the derivative of q, their correlation) of one joint; None where it hardly moves, or where
    noise alone may be why the two differ. unsigned: over the derivative without its sign.

    t (N,) increasing; both are averaged over the same cells of a twentieth of the time scale of the motion.
    """
    good = np.isfinite(q) & np.isfinite(dq) & np.isfinite(t)
    t, q, dq = t[good], q[good], dq[good]
    keep = np.diff(t, prepend=-np.inf) > 0
    t, q, dq = t[keep], q[keep], dq[keep]
    if len(t) < 200 or np.ptp(q) < 0.02 or np.ptp(dq) == 0:
        return None
    step = np.median(np.diff(t))
    width = max(3, min(25, len(t) // 400))
    # over one cell: the mean of dq is the difference of q over the cell's length, whatever the noise
    total = np.concatenate([[0.0], np.cumsum(0.5 * (dq[1:] + dq[:-1]) * np.diff(t))])
    best = (0.0, 0.0)
    most = int(min(LAG_S / step, 40)) if step < LAG_S else 1
    usual = np.diff(t) < 10 * step
    breaks = np.concatenate([[0], np.cumsum(~usual)])
    for lag in sorted({round(k) for k in np.linspace(0, max(most, 1), 9)}):
        a, b = np.arange(0, len(t) - width - lag), np.arange(width, len(t) - lag)
        same = breaks[a] == breaks[b + lag]
        x, y = (q[b] - q[a])[same], (total[b + lag] - total[a + lag])[same]
        x = np.abs(x) if unsigned else x
        if len(x) < 100 or not np.any(x):
            continue
        r = float(x @ y / np.sqrt(max((x @ x) * (y @ y), 1e-300)))
        if abs(r) > abs(best[1]):
            best = (float(x @ y / (x @ x)), r)
    if abs(best[1]) < ALIKE and not all(_moves(x, width, breaks) for x in (q, total)):
        return None
    return best if best[1] else None


def _moves(x: np.ndarray, width: int, breaks: np.ndarray) -> bool:
    """Whether what x (N,) gains over `width` samples is more than the noise that a cubic leaves of it; not
    over the gaps that `breaks` (N,) counts. (A UR10e that stands in ten poses went from one to the next.)"""
    noise = x[2:-2] - (-x[:-4] + 4 * x[1:-3] + 4 * x[3:-1] - x[4:]) / 6
    gains = (x[width:] - x[:-width])[breaks[width:] == breaks[:-width]]
    noise = noise[breaks[4:] == breaks[:-4]]
    return bool(len(gains) and len(noise) and np.std(gains) > ABOVE_NOISE * np.std(noise))


def _read(
    columns: Columns, stream: RecordingStream, table: Table, has: dict[str, tuple[str, float, float]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """t (N,), q and dq (N, k) of the joints that have both, from the first rows that move."""
    parts, count = [], 0
    for _, t, q, dq in with_velocities(columns, stream, table, has):
        parts.append((t, q, dq))
        if len(q) and np.ptp(q, axis=0).max() > 1e-3:
            count += len(q)
        if count >= ROWS:
            break
    if not parts:
        return np.zeros(0), np.zeros((0, len(has))), np.zeros((0, len(has)))
    t, q, dq = (np.concatenate(part) for part in zip(*parts))
    return t, q, dq


def with_velocities(
    columns: Columns, stream: RecordingStream, table: Table, has: dict[str, tuple[str, float, float]]
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Blocks: rows (N,) of the table, t (N,), q and dq (N, k) of the joints that have both, inside the
    window and without what was mended away; NaN where a velocity is no measurement. (Of an AIRBOT that logs
    -999 for what was lost the velocities were told to be another signal's.)"""
    n, m = len(columns.labels), len(stream.signal_joints)
    mine, row, mending = [columns.labels.index(j) for j in has], 0, stream.survey.mending
    joints = np.concatenate([stream.signal_joints, np.zeros(len(has), int)])
    factor, offset = np.array([its[1:] for its in has.values()]).T
    for block in table.blocks([*stream.names, *(where for where, _, _ in has.values())]):
        rows = np.arange(row, row + len(block))
        row += len(block)
        plain = block[:, : len(stream.names)] * stream.factors + stream.offsets
        t = stream.times(rows, plain)
        inside = (t >= stream.window[0]) & (t < stream.window[1])
        if not inside.any():
            continue
        dq = block[:, len(stream.names) :] * factor + offset
        mark, gross = no_measurement(dq, factor, offset, np.zeros(len(has)))
        dq[mark | gross] = np.nan
        values, rows = np.hstack([plain[:, -m:], dq])[inside], rows[inside]
        t, values, _ = mending.apply(rows, t[inside], values, n, joints)
        rows = rows[~np.isin(rows, mending.dropped)] if len(mending.dropped) else rows
        yield rows, t, values[:, mine], values[:, m:]
