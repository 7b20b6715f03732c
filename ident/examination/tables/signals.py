"""What the columns of one table show each for itself: lost samples, dead torques, resting joints, limits hit.

Every function is pure: what one pass counted goes in, checks come out.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ident.examination.check import Check, column_line, listed
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.mending import Mender
from ident.signals.runs import runs_of, runs_of_equals

MOST_MISSING = 0.05
MOST_SPIKES = 0.01
MOST_BAND = 0.5  # of a torque: what is left of it tells the robot as well
BEYOND = 3.0  # standard deviations of a count
MOVED = 1e-3  # rad or m: less is rest
TURNS = 4 * np.pi
BESIDE_ROWS, CHANCE = 30, 1e-3  # behind a leap; of as many rows in which nothing happens to change
FASTER = 3.0  # times what a position goes from row to row at most: no joint does meanwhile
COUNTS = 1000.0  # rad: beyond it no joint goes, but an encoder's counts do
LARGEST = 2e4  # N m: more than robots' joints give
BESIDE = 1000**0.5  # times smaller: torques of one robot in one unit rather than in two, a thousand apart
CLIPPED_RUN = 5  # consecutive samples exactly at the extreme while the joint moves
CLIPPED_EXCESS = 6.0  # of samples at the extreme over those just below it; a rounded peak has 2.4


@dataclass(frozen=True, slots=True)
class Columns:
    """Names of one table's signals: positions, then torques; `joint` (m,) from 0, labels (n,)."""

    recording: str
    signals: tuple[str, ...]  # the study's names: q1.., tau_m1.. or i1.., tau_l1..
    joint: np.ndarray
    labels: tuple[str, ...]
    maps: Mapping[str, Any]  # the study's column maps
    channels: tuple[str, ...]  # torques in use
    prismatic: np.ndarray  # (n,) bool
    cutoff_hz: float = 10.0  # of the filter that positions go through
    own_units: bool = False  # whether motor signals stay in a unit of their own, as currents without gains do
    beside: bool = False  # whether the study has other recordings

    @property
    def n(self) -> int:
        return len(self.labels)

    def sized(self, k: int, x: float, digits: int = 3) -> str:
        """A number of a signal in the unit in which it is read: of a current N m, which no log says."""
        position, slides = k < self.n, bool(self.prismatic[self.joint[k]])
        unit = (("rad", "m") if position else ("N m", "N"))[slides]
        own = self.own_units and not position and not self.signals[k].startswith("tau_l")
        return f"{x:.{digits}g}" + ("" if own else f" {unit}")

    def line(self, changes: Mapping[str, Mapping[str, Any]]) -> str:
        """The `columns:` line with these changes."""
        return column_line(self.maps, changes, self.beside)

    def without(self, dead: Sequence[str]) -> str:
        """The `channels:` line that leaves torques out."""
        gone = {"tau_m" + name[1:] if name.startswith("i") else name for name in dead}
        gone |= {"tau_d" + name[5:] for name in gone}
        return f"channels: [{', '.join(name for name in self.channels if name not in gone)}]"


_WORDS = {
    "missing_values": "empty or not a number",
    "sentinel": "a logger's mark for no value",
    "frozen": "frozen: nothing at all changes, though joints were on their way",
    "ended": "frozen to the end: nothing at all changes any more, though joints were on their way",
    "spike": "a spike, far off its neighbours in the signal's own noise",
}
_WHOLE = ("frozen", "ended")  # rows, not samples of a signal
_MOST = {"spike": MOST_SPIKES, "ended": 1.0}  # what lies before the end is as good as it was
_CURE = {
    "missing_values": "export the log without them, or leave the stretch out with from: and to:",
    "sentinel": "export the log without them, or leave the stretch out with from: and to:",
    "frozen": "leave the stretches out with from: and to:",
    "spike": "find what disturbs this sensor or its cable, or what exchanges rows",
}


def lost_samples(columns: Columns, mender: Mender, rows: int) -> Iterator[Check]:
    """One check a kind of samples that are no measurement."""
    for kind, counts in mender.counts.items():
        if kind == "dead_band":
            continue
        mine = np.flatnonzero(counts)
        if kind == "spike":
            mine = np.array([k for k in mine if not _after_a_stop(mender, int(k))], int)
        if not len(mine):
            continue
        worst = int(counts[mine].max())
        limit = _MOST.get(kind, MOST_MISSING)
        chance = BEYOND * np.sqrt(worst) if kind == "spike" else 0.0  # of few rows two are no share
        refused = worst - chance > limit * rows
        names = tuple(columns.signals[k] for k in mine)
        seen = mender.first[kind].values()
        span = min(a for a, _ in seen), max(b for _, b in seen)
        subject = "all signals" if kind in _WHOLE else listed(names)
        if refused:
            said = f"{worst} of {rows} samples of {names[int(np.argmax(counts[mine]))]} are"
            message = f"{said} {_WORDS[kind]} (rows {span[0]} to {span[1]}), more than {100 * limit:g} %"
        else:
            number = worst if kind in _WHOLE else int(counts[mine].sum())
            message = (
                f"{number} sample{'s' if number > 1 else ''} of {subject} "
                f"{'are' if number > 1 else 'is'} {_WORDS[kind]} (rows {span[0]} to {span[1]}); "
                f"{_done(kind, number, mender.left_out if (mine < columns.n).any() else 0)}"
            )
        cure = _CURE[kind] if refused else ""
        if refused and kind == "missing_values" and 2 * mender.whole < rows - worst:
            message += f", and {mender.whole} of the rows hold every signal"
            cure = "where logs with stamps of their own were put together interpolate them to the same stamps"
        check = {"sentinel": "missing_values", "ended": "frozen"}.get(kind, kind)
        yield Check(
            check,
            () if kind in _WHOLE else names,
            message,
            cure,
            outcome="refused" if refused else "mended",
            rows=span,
        )
    if mender.truncated is not None:
        row = mender.truncated + 1
        yield Check(
            "truncated",
            (),
            f"the last row ({row}) is not whole and was left out",
            outcome="mended",
            rows=(row, row),
        )


def frozen_throughout(recording: str, rows: int, left_out: bool) -> Check:
    """A recording all of whose rows are the same."""
    said = f"all {rows} rows are the same, positions and torques: a logger or a driver that was frozen"
    said += ", or a robot at rest whose signals are too coarse to show it"
    if left_out:
        return Check("frozen", (), f"{said}; left out", outcome="mended", recording=recording, rows=(1, rows))
    return Check("frozen", (), said, "record it again, moving", "refused", recording, (1, rows))


def _done(kind: str, number: int, long: int) -> str:
    """What was done to samples, of which `long` are in stretches that nothing can cross."""
    if kind in _WHOLE or long >= number:
        return "left out"
    crossed = "interpolated, and given no weight in the fit"
    return f"{long} of them in long stretches left out, the others {crossed}" if long else crossed


def _after_a_stop(mender: Mender, k: int) -> bool:
    """Whether a signal's spikes are the leap with which it goes on after the logger stood still."""
    first, last = mender.first["spike"][k]
    return any(first > stop and last <= stop + 3 for _, stop in mender.first.get("frozen", {}).values())


def wraps(columns: Columns, mender: Mender) -> Iterator[Check]:
    """Positions that leap by a whole turn were made continuous; not to a spike and back."""
    mending = mender.mending()
    for k in np.unique(mending.wrap_columns):
        mine, lost = mending.wrap_columns == k, mending.rows[mending.columns == k]
        kept = ~np.isin(mending.wrap_rows[mine], [lost, lost + 1])
        rows, turns = mending.wrap_rows[mine][kept] + 1, mending.wrap_turns[mine][kept]
        if not len(rows):
            continue
        there = np.flatnonzero((np.diff(rows) == 1) & (turns[1:] == -turns[:-1]))
        back = 2 * len(there) == len(rows)  # of a spike, too
        count = len(there) if back else len(rows)
        yield Check(
            "wrap",
            (columns.signals[k],),
            f"{columns.signals[k]} leaps by {'whole turns and back' if back else 'a whole turn'} {count} "
            f"time{'s' if count > 1 else ''} (first in row {rows[0]}); made continuous",
            outcome="mended",
            rows=(int(rows[0]), int(rows[-1])),
        )


def position_steps(
    columns: Columns, mender: Mender, excerpt: Excerpt, slow: Collection[int] = ()
) -> Iterator[Check]:
    """A position that leaps and stays is an encoder that slipped, or rows that are gone; one that stood still
    before, while another one moved, was held meanwhile; of most that leap in one row rows are gone. slow:
    those that change every so many rows only, all of whose changes are leaps. (Of a TX40 at 5 kHz whose
    signals were new every 0.01 s all positions leapt, as where rows were cut out.)"""
    spikes = mender.counts.get("spike", np.zeros(len(columns.signals)))
    steps = [step for step in mender.leaps if spikes[step[1]] < 20]  # what is left of spikes is no step
    steps = [
        (row, k, size)
        for row, k, size in steps
        if k not in slow or abs(size) > FASTER * _farthest(excerpt, row, k)
    ]
    if not steps:
        return
    row, k, size = steps[0]
    leap = columns.sized(k, size)
    names = tuple(dict.fromkeys(columns.signals[j] for _, j, _ in steps))
    at_once = tuple(dict.fromkeys(columns.signals[j] for its, j, _ in steps if its == row))
    held = _held_until(excerpt, row, k, size)
    if held is not None:
        first, stale = held
        rows = first + 1, row
        name, still = columns.signals[k], f"stands still in rows {rows[0]} to {rows[1]}"
        if stale:
            said = (
                f"every signal {still}, and then {name} leaps by {leap}: messages that were lost, the last "
            )
            said += "one written on"
        else:
            said = (
                f"{name} {still}, in which others change, and then leaps by {leap}: an encoder or a message "
            )
            said += "that was held"
        remedy = "leave these rows out with from: and to:"
    else:
        rows = row + 1, row + 1
        remedy = "use the part before or after it with from: and to:"
        said = f"{columns.signals[k]} leaps by {leap} in row {row + 1} and stays there, as when "
        said += "an encoder slips, rows were cut out or recordings were put together"
        if len(at_once) > max(1, columns.n / 2):
            said = f"{listed(at_once)} leap in row {row + 1}, {columns.signals[k]} by {leap}, and "
            said += "stay there: rows were cut out, or recordings were put together"
    yield Check("position_step", names, said, remedy, outcome="refused", rows=rows)


def _farthest(excerpt: Excerpt, row: int, k: int) -> float:
    """How far a position goes from one row to the next at most, but for the way to one row."""
    ways = [np.abs(np.diff(x[:, k]))[rows[1:] != row] for rows, _, x in excerpt.pieces]
    return max((float(way.max()) for way in ways if len(way)), default=0.0)


def _held_until(excerpt: Excerpt, row: int, k: int, size: float) -> tuple[int, bool] | None:
    """The first row of those up to a leap in which a position does not change, as it does behind it, though
    others do from row to row, or as none does, and whether none does; None where chance leaves as many, or it
    goes as far in so many nowhere.
    (0.3 s of a Franka's at 50 Hz were 15 rows, and it was said to have slipped; of an AIRBOT's log that was
    cut the first position, which happened not to change in the row before, was held and leapt by 0.3 rad.)"""
    for rows, _, values in excerpt.pieces:
        at = int(np.searchsorted(rows, row))
        if not 0 < at < len(rows) or rows[at] != row:
            continue
        changes = np.flatnonzero(np.diff(values[:at, k]))
        first = int(changes[-1]) + 1 if len(changes) else 0
        others = np.delete(np.diff(values[first:at], axis=0) != 0, k, axis=1).any(axis=1)
        goes_on = np.diff(values[at : at + BESIDE_ROWS, k]) != 0  # or the joint rests
        stale = len(others) > 0 and not others.any()
        told = stale or (len(others) > 0 and others.mean() > 0.5)
        if not told or not (goes_on.mean() if len(goes_on) else 0) > 0.5:
            return None
        if abs(size) > FASTER * _farthest(excerpt, row, k) * (at - first):
            return None
        rests = 1 - (len(changes) + goes_on.sum()) / (first + len(goes_on) + 1)
        return (int(rows[first]), stale) if rests ** (at - first) < CHANCE else None
    return None


def dead_and_resting(
    columns: Columns, lowest: np.ndarray, highest: np.ndarray, empty: Collection[int] = ()
) -> Iterator[Check]:
    """Torques that never change, joints that never move. lowest, highest (m,); empty: without any number."""
    n, reach = columns.n, highest - lowest
    still = [k for k in range(n) if reach[k] < MOVED]
    if still:
        which = listed(columns.labels[k] for k in still)
        exact = listed(columns.signals[k] for k in still if reach[k] == 0)  # no encoder is as still as that
        or_lost = f" ({exact} to the last digit: unless held, not recorded)" if exact else ""
        yield Check(
            "resting_joint",
            tuple(columns.signals[k] for k in still),
            f"joint {which} never moves{or_lost}, so its own friction and inertia cannot be seen here, and "
            "its offset holds the friction that it rests with",
            "record it moving",
        )
    every = [k for k in range(n, len(reach)) if reach[k] == 0 and columns.joint[k] not in still]
    dead = [k for k in every if k in empty] or every
    if not dead:
        return
    names = tuple(columns.signals[k] for k in dead)
    everything = len(dead) == len(reach) - n
    value = f"{lowest[dead[0]] + 0.0:g}"  # no -0
    clipped = lowest[dead].all()  # a short run may be, whole
    cause = "dead, absent or held at the end of its range" if clipped else "dead or absent"
    reads = f"{'reads' if len(names) == 1 else 'read'} {value} throughout"
    if dead[0] in empty:
        reads = f"{'holds' if len(names) == 1 else 'hold'} no number in any row"
    yield Check(
        "dead_channel",
        names,
        f"{listed(names)} {reads}: {cause}"
        if not everything
        else f"no torque is recorded: {listed(names)} never changes while joints move",
        "map the right columns with columns: {...}"
        if everything
        else f"leave {'it' if len(names) == 1 else 'them'} out with {columns.without(names)}",
        outcome="refused",
    )


def posed(
    columns: Columns, lowest: np.ndarray, highest: np.ndarray, resting: Sequence[Collection[int]]
) -> Iterator[Check]:
    """Joints that stand in every one of a recording's stretches, here and there; lowest, highest (m,),
    resting: the joints that stand, stretch by stretch."""
    still = set.intersection(*map(set, resting)) if resting else set()
    which = sorted(j for j in still if highest[j] - lowest[j] >= MOVED)
    if which:
        whole = len(which) == columns.n
        names = "the robot" if whole else f"joint {listed(columns.labels[j] for j in which)}"
        yield Check(
            "resting_joint",
            tuple(columns.signals[j] for j in which),
            f"{names} stands still in each of the {len(resting)} stretches: dry friction at rest is anything "
            f"up to that of motion, and nothing {'' if whole else 'of its torque '}is used beside recordings "
            "of motion",
            "record slow moves there and back through these places",
        )


def flags(columns: Columns, excerpt: Excerpt) -> Iterator[Check]:
    """A signal of two values is a switch, or too small for its resolution. A joint at rest is neither. (Of a
    UR10e that rests three seconds, whose encoder flickers by its one step, q1 was refused as a switch.)"""
    for k, name in enumerate(columns.signals):
        values = excerpt.column(k)
        if k < columns.n and np.ptp(values) < MOVED:
            continue
        distinct = np.unique(values[:: max(1, len(values) // 2000)])
        if len(distinct) == 2 and len(values) > 200 and len(np.unique(values)) == 2:
            if k >= columns.n and not _switch(distinct):
                yield Check(
                    "coarse_signal",
                    (name,),
                    f"{name} holds only two values, {distinct[0]:g} and {distinct[1]:g}: it stays below its "
                    "own resolution, and nothing is seen of it",
                    f"leave it out with {columns.without([name])}",
                )
                continue
            out = f", or leave it out with {columns.without([name])}" if k >= columns.n else ""
            yield Check(
                "flag_column",
                (name,),
                f"{name} holds only two values, {distinct[0]:g} and {distinct[1]:g}: a switch, or a signal "
                "below its own resolution",
                f"map the right column with columns: {{{name}: {{column: ...}}}}{out}",
                outcome="refused",
            )


def _switch(values: np.ndarray) -> bool:
    """Whether two values are those of a switch: whole numbers, or leaps beyond a torque's resolution."""
    return bool((values == np.rint(values)).all() or np.ptp(values) > 0.5)


def limits_hit(
    columns: Columns,
    excerpt: Excerpt,
    slow: Collection[int] = (),
    in_steps: Callable[[np.ndarray], bool] = lambda x: False,
) -> Iterator[Check]:
    """Torques that stay exactly at their extreme while the joint moves; slow: those that are held anyway;
    in_steps: whether one moves in steps, so that it stands still where it is slow.
    What is recorded late begins with one value. (Of a rokae's torques, 0.03 s late, one was told.)
    What stands still as much at other values is not clipped. (Of an LWR4+'s sixth sensor with play a wider
    range was to be; of a slide whose force was little else than dry friction and weight, in 120 steps.)
    What is there once may be held. (Of a TX40's fifth, held for half of a run, it was told to be clipped.)"""
    for k in range(columns.n, len(columns.signals)):
        if k in slow:
            continue
        x, q = excerpt.column(k), excerpt.column(int(columns.joint[k]))
        steps, moves = np.abs(np.diff(x)), np.abs(np.diff(q, append=q[-1:])) > 0
        smallest = np.quantile(steps[steps > 0], 0.1) if (steps > 0).any() else 0.0
        ends: dict[str, int] = {}
        times = 0  # it is there
        for sign, word in ((1.0, "largest"), (-1.0, "smallest")):
            y, moving = sign * x, moves.copy()
            top = y == y.max()
            if excerpt.pieces[0][0][0] == 0:
                moving[: int(np.argmin(top))] = False
            count = int((top & moving).sum())
            if count < 4 * CLIPPED_RUN or y.max() == 0:
                continue
            beside = y.max(where=~top, initial=y.min())  # farther below where steps are of several sizes
            below = (y >= min(y.max() - 1.05 * max(smallest, 0.005 * np.ptp(x)), beside)) & ~top
            if count < CLIPPED_EXCESS * max(below.sum(), 1):
                continue
            long = int(np.count_nonzero(np.diff(runs_of(top)) >= CLIPPED_RUN))
            times += long
            if long:
                ends[f"its {word} value {columns.sized(k, sign * y.max(), 4)}"] = count
        if not ends:
            continue
        coarse = in_steps(x)
        still = _rests(x, moves, smallest) if coarse else _stands(x, moves)
        if still < max(ends.values()):
            clipped = "as a signal that is clipped" + ", or a value that is held" * (times == 1)
            leave_out = ", or leave the stretch out with from: and to:" * (times == 1)
            yield Check(
                "saturation",
                (columns.signals[k],),
                f"{columns.signals[k]} stays exactly at {' and '.join(ends)} for "
                f"{100 * sum(ends.values()) / len(x):.2g} % of the samples, {clipped}",
                f"record with a wider range, or a slower motion{leave_out}",
            )
        elif not coarse:
            yield _with_play(columns.signals[k], (still + sum(ends.values())) / len(x))


def _stands(x: np.ndarray, moving: np.ndarray) -> int:
    """Rows of a torque (N,) in which it keeps a value, none of its ends, as long as a clipped one has to."""
    _, length = runs_of_equals(x)
    long = np.repeat(length >= CLIPPED_RUN, length)
    return int((long & moving & (x > x.min()) & (x < x.max())).sum())


def _rests(x: np.ndarray, moving: np.ndarray, step: float) -> int:
    """Rows of a torque (N,) in such steps in which it is at a value between others as it has to be at the
    limit of one that is clipped: many times as often as beside it."""
    level, count = np.unique(np.rint((x[moving] - x.min()) / step), return_counts=True)
    apart = np.diff(level)
    below, above = (np.where(its == 1, n, 1) for its, n in ((apart[:-1], count[:-2]), (apart[1:], count[2:])))
    return int(count[1:-1][count[1:-1] > CLIPPED_EXCESS * np.maximum(below, above)].sum())


def _with_play(name: str, share: float) -> Check:
    return Check(
        "held_signal",
        (name,),
        f"{name} stands still at its largest value and at others, for {100 * share:.2g} % of the samples "
        "while its joint moves: play or friction in the sensor or before it, or values that are held",
        "look at its plot against the position; where it turns back it tells less than it seems to",
    )


def dead_bands(columns: Columns, mender: Mender, rows: int) -> Iterator[Check]:
    """Torques that read 0 where they are small: that is no measurement, and has no weight."""
    counts = mender.counts.get("dead_band", np.zeros(0, int))
    for k in np.flatnonzero(counts).tolist():
        name, share = columns.signals[k], counts[k] / rows
        refused = share > MOST_BAND
        done = "" if refused else "; these have no weight in the fit"
        out = f", or leave it out with {columns.without([name])}" if refused else ""
        yield Check(
            "dead_band",
            (name,),
            f"{name} reads 0 wherever it is below {mender.bands[k]:.3g}, in {100 * share:.2g} % of the "
            f"samples: a dead band of the sensor, the drive or the logger{done}",
            f"log it without that band{out}",
            outcome="refused" if refused else "warned",
            rows=mender.first["dead_band"][k],
        )


def units(
    columns: Columns, mender: Mender, excerpt: Excerpt, lowest: np.ndarray, highest: np.ndarray
) -> Iterator[Check]:
    """Positions beyond what joints reach, for two rows at least: counts of an encoder; torques that only N mm
    give. One joint may go beyond two turns; where all that move do it is what a diagnosis begins with. (Of a
    TX40 in degrees it said that structure in four joints' torques is unexplained.) In whole numbers it is no
    position behind a gear. (Of a KR 300's sixth in counts of 4096 a turn that was told, or degrees.)"""
    n = columns.n
    reach = np.maximum(np.abs(lowest), np.abs(highest))
    for k in range(n):  # of spikes that stand too close to be told it was said to be in degrees
        x = np.abs(excerpt.column(k))
        reach[k] = np.minimum(x[:-1], x[1:]).max(initial=0.0)
    no_doubt = {*np.flatnonzero(columns.prismatic), *mender.mending().wrap_columns}  # leaps by 2 pi are rad
    far = [k for k in range(n) if TURNS < reach[k] <= COUNTS and k not in no_doubt]
    whole = [k for k in far if np.median(np.abs(excerpt.column(k) - np.rint(excerpt.column(k)))) == 0]
    counts = [k for k in range(n) if reach[k] > COUNTS or k in whole]
    if counts:
        names = [columns.signals[k] for k in counts]
        change = {"scale": "2*pi/(counts per turn * gear ratio)"}
        yield Check(
            "angle_unit",
            tuple(names),
            f"{names[0]} reaches {reach[counts[0]]:.4g}{' in whole numbers' if counts[0] in whole else ''}, "
            f"which no joint does in rad: {listed(names)} {'look' if counts[1:] else 'looks'} like an "
            f"encoder's counts{', or degrees without decimals' if whole else ''}",
            f"write columns: {{{names[0]}: {{scale: {change['scale']}}}, ...}} in the study, as a number"
            f"{', or scale: 0.0174533 if degrees' if whole else ''}",
            outcome="refused",
        )
    far = [k for k in far if k not in whole]
    if far:
        names = [columns.signals[k] for k in far]
        going = (highest - lowest)[:n] > MOVED
        others = {*np.flatnonzero(going & ~columns.prismatic)} - {*far}
        another = ", or like another signal in its column" * bool(others)
        yield Check(
            "angle_unit",
            tuple(names),
            f"{names[0]} reaches {reach[far[0]]:.4g}, more than two turns in rad, it looks like degrees or "
            f"the motor's side of the gear{another} (joints {listed(columns.labels[k] for k in far)})",
            "if degrees, write "
            + columns.line({name: {"scale": 0.0174533} for name in names})
            + "; if the motor's side, the same with scale: 1/ratio of the gear (100: 0.01)",
            hint=True,
            open=len(far) > 1 and not others,
        )
    yield from _too_large(columns, reach)


def _too_large(columns: Columns, reach: np.ndarray) -> Iterator[Check]:
    """Torques beyond LARGEST, side by side of the gear: a log has one unit, so that where others stand beside
    them as torques of one robot do they all have it. reach (m,)."""
    n = columns.n
    kinds = [name.rstrip("0123456789") for name in columns.signals]
    for kind in dict.fromkeys(kinds[n:]):
        side = [k for k in range(n, len(reach)) if kinds[k] == kind and reach[k] > 0]
        large = [k for k in side if reach[k] > LARGEST]
        if not large:
            continue
        top = max(large, key=lambda k: reach[k])
        others = [k for k in side if k not in large]
        beside = [k for k in others if BESIDE * reach[k] > reach[top]]
        whole = 2 * len(beside) >= len(others)
        milli = "mA" if kind == "i" else "N mm"
        names, every = ([columns.signals[k] for k in ks] for ks in (large, side))
        lines = [columns.line({m: {"scale": 0.001} for m in ms}) for ms in (names, every)]
        remedy = f"if {milli}, write {lines[whole]}"
        if beside and not whole:
            remedy += f" where these alone are, {lines[1]} where all are"
        yield Check(
            "torque_scale",
            tuple(every if whole else names),
            f"{columns.signals[top]} reaches {reach[top]:.3g} N m, more than robots' joints give"
            f"{', and the others are of its size, as in one unit' if whole and others else ''}: {milli}, or "
            f"another gain ({listed(every if whole else names)})",
            remedy,
            hint=True,
        )
