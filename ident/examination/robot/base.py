"""Whether gravity is where the robot file says.

It is sought over the whole sphere, and then in its size, where accelerations fix one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.bodies import Parts, beyond_own, by_own, errors, gain
from ident.examination.fits.first_axis import ROBOT_FILE, ROUND_ANGLE, FirstAxis, gravity_line
from ident.examination.fits.hypothesis import BAD, BAD_TOGETHER, Hypothesis
from ident.examination.fits.quick import Assignment
from ident.examination.fits.sphere import degrees_between, sought
from ident.examination.fits.stretches import ODD, beyond_chance
from ident.examination.rivals.carried import CARRIED, Carried, ambiguous, carried, span
from ident.examination.robot.gravity import Direction

AXES = 6  # of a base
CLEARLY = 1.0  # gain, summed over the channels, on identify; half of it on validate
UNSEEN = 0.5  # gain of the gravity that is assumed over another, below which neither is known
LEAST_ANGLE = 8.0  # degrees; smaller tilts are the diagnosis's effect base_tilt
HALFWAY = 45.0  # from one axis of the base to another: what is known no better has no line


@dataclass(frozen=True, slots=True)
class Tilt:
    """A gravity (3,) close to the file's, and what it gains: the diagnosis's to measure and to tell."""

    gain: float
    gravity: np.ndarray


def base_orientation(
    identify: Parts,
    validate: Parts | None,
    assumed: np.ndarray,
    how: Assignment,
    rivals: Callable[[], Sequence[Carried]] | None = None,
    stretches: Callable[[], tuple[Parts, Sequence[Parts]]] | None = None,
    names: Sequence[str] = (),
    aside: np.ndarray | None = None,
    measured: Callable[[np.ndarray, Sequence[int]], Direction] | None = None,
    first: FirstAxis | None = None,
    tables: Callable[[np.ndarray, Sequence[int]], Sequence[str]] | None = None,
    told_by: str = ROBOT_FILE,
) -> Iterator[Hypothesis | Tilt]:
    """Gravity in any direction, and of any size where accelerations show it; assumed (3,) is as
    `told_by`, a file, has it.
    rivals: the other faults with which the model would predict validate; None where a fault is known already.
    stretches: all that fits and judges, as one and in pieces. names (C,) of the signals; aside: channels that
    are not taken, as with the gravity that all tell they contradict the others. measured: where gravity is by
    all rows, begun at a (3,), without some channels, and how well they tell it. first: the joint whose zero
    may be what gravity is told to be. tables: what the robot file may have wrong instead, in words.
    What the fitted recordings do not show, validate tells only if none of them predicts it about as well. A
    small tilt has no check (of an AIRBOT tilted by 6 degrees it was told
    that it hangs the other way round)."""
    size = float(np.linalg.norm(assumed)) or 9.81
    plain, held = errors(identify, validate, assumed)

    def score(g: np.ndarray) -> float:
        return gain(plain, errors(identify, None, g, 2)[0])

    best = sought(identify, plain, size)[0]
    value = score(best)
    axes = [size * np.sign(a) * np.eye(3)[k] for k in range(3) for a in (-1, 1)]
    close = [a for a in axes if np.degrees(np.arccos(np.clip(a @ best / size**2, -1, 1))) < ROUND_ANGLE]
    if close and score(close[0]) > value - max(0.3, 0.25 * value):
        best, value = close[0], score(close[0])
    for factor in (0.0, 9.81 / size):
        other = factor * best
        if abs(factor - 1) > 0.2 and score(other) > value + CLEARLY:
            best, value = other, score(other)
    now, after = errors(identify, validate, best)
    norm = float(np.linalg.norm(best))
    small = norm > 0 and degrees_between(assumed, best) < LEAST_ANGLE and abs(norm / size - 1) < 0.2
    if small:
        yield Tilt(value, best)
    if value < CLEARLY or gain(held, after) < 0.5 * CLEARLY or small:
        told = [] if rivals is None else _by_validate(identify, validate, assumed, size)
        if told and stretches is not None:
            whole, pieces = stretches()
            told = [its for its in told if its.gravity is None or _asked(whole, pieces, assumed, its.gravity)]
        if rivals is None or not told:
            return
        close_to = told[0].gain - 0.25 * CARRIED
        if small and carried(plain, now, held, after) > close_to:
            return
        alike = [its for its in (*told[1:], *rivals()) if its.gain > close_to]
        if alike:
            yield Hypothesis(told[0].gain, how, ambiguous(held, [told[0], *alike]))
            return
        assert told[0].gravity is not None
        best = told[0].gravity
        now, after = errors(identify, validate, best)
        assert held is not None and after is not None
        value, plain, now = gain(held, after), held, after
        where = " of the recordings that validate"
    else:
        where = ""
    known, norm, within = "", float(np.linalg.norm(best)), 0.0
    if norm and measured is not None and degrees_between(assumed, best) > LEAST_ANGLE:
        seen = measured(best, [] if aside is None else aside.tolist())
        best, within = _named(seen)
        straight = np.count_nonzero(best) == 1
        known = ", along an axis of the base as far as these recordings tell" if straight else ""
        known += f" (within {np.ceil(within):.0f} degree{'s' if within > 1 else ''})"
        now, after = errors(identify, validate, best)
        if where and held is not None and after is not None:
            plain, now = held, after
    before, error = (errors(identify, None, g)[0] for g in (assumed, best))
    each = by_own(identify, best)
    beside = beyond_own(error, each)
    if beside.any() and aside is None:  # what turns gravity may be a fault of their own
        less = None if validate is None else validate.without(beside)
        its, kept_out = identify.without(beside), np.flatnonzero(beside)
        of_rest = base_orientation(
            its, less, assumed, how, None, None, names, kept_out, measured, first, tables, told_by
        )
        yield from (h for h in of_rest if isinstance(h, Hypothesis))
    if beside.any() or not _explained(before, error):  # something else is missing
        return
    gains = gain(plain, now) >= CLEARLY and gain(held, after) >= 0.5 * CLEARLY
    if known and (within >= HALFWAY or degrees_between(assumed, best) <= within or not gains):
        return
    if known and degrees_between(assumed, best) < LEAST_ANGLE:
        yield Tilt(value, best)
        return
    if aside is not None:
        where += f" without {listed([names[c] for c in aside])}, which the others contradict,"
    line = gravity_line(best)
    angle = degrees_between(assumed, best)
    turned = f"turned by {angle:.0f} degrees against {told_by}'s{known}" if norm else "absent"
    if norm and not np.any(assumed):
        turned, why = f"not zero, as {told_by}'s is", f"these torques feel what the arm weighs{known}"
    elif norm and angle < LEAST_ANGLE:
        turned = f"{norm:.3g} m/s^2, not {size:.4g} as {told_by} says"
        why = "its unit is another"
    else:
        zero = "" if first is None else first.zero_of(assumed, best, max(within, ROUND_ANGLE))
        why = f"the base is mounted otherwise, or its frame is{zero}"
    several = aside is not None and len(aside) > 1
    if several:
        why += ", or a position or a row of the robot file is wrong, by which torques contradict the others"
        line = f"check positions and the robot file, or write {line}"
    told_base = Hypothesis(
        value,
        how,
        Check(
            "base_orientation",
            (),
            f"gravity is {turned}: {why}; so taken, the errors of the torques{where} "
            f"fall from {span(plain)} to {span(now)}",
            line,
            open=several,
        ),
        words=f"gravity is {turned}",
        each=gain(by_own(identify, assumed), each),
    )
    instead = [] if tables is None else tables(best, [] if aside is None else aside.tolist())
    silent = replace(told_base, check=replace(told_base.check, remedy=""))
    yield told_base.beside([replace(silent, words=its) for its in instead])


def _explained(before: np.ndarray, error: np.ndarray) -> bool:
    """Whether most is gained by torques that gravity explains, and none is no longer explained. (Twelve
    seconds of an AIRBOT on a wall hardly move its first joint: that torque fell from 42 to 35 %, the others
    from 60 to 8 %, and it was told that none shows gravity.)"""
    seen, done = np.isfinite(error), error <= BAD
    kept = (done | (before > BAD))[seen].all()
    return bool(kept and done.any() and gain(before[done], error[done]) > gain(before[~done], error[~done]))


def _named(seen: Direction) -> tuple[np.ndarray, float]:
    """What is told of gravity (3,), an axis of the base that is within what is known of it, and to how many
    degrees."""
    size = float(np.linalg.norm(seen.gravity))
    near = min(
        size * np.vstack([np.eye(3), -np.eye(3)]), key=lambda axis: degrees_between(seen.gravity, axis)
    )
    return near if degrees_between(seen.gravity, near) <= seen.within else seen.gravity, seen.within


def unseen(
    identify: Parts, validate: Parts | None, assumed: np.ndarray, told_by: str = ROBOT_FILE
) -> Iterator[Check]:
    """Said where another axis of the base could as well be upright: what few joints feel of gravity, first
    moments make up for, and only their part in the inertia contradicts. A base told wrongly is not named. Of
    torques none of which is explained every base explains as much. (Of an AIRBOT whose second position was a
    rate so much was said of errors of 23 to 79 %.) What a controller's gravity leaves of the arm's, where
    torques are logged without it, has as little to do with inertia, either."""
    plain, held = errors(identify, validate, assumed)
    if not np.nanmin(plain) < BAD_TOGETHER:
        return
    told = []
    for axis in np.linalg.norm(assumed) * np.vstack([np.eye(3), -np.eye(3)]):
        now, after = errors(identify, validate, axis)
        alike = gain(now, plain) < UNSEEN and (held is None or gain(after, held) < UNSEEN)
        if alike and degrees_between(assumed, axis) > ROUND_ANGLE:
            told.append((degrees_between(assumed, axis), now))
    if told and np.any(assumed):
        angle, now = max(told, key=lambda its: its[0])
        yield _unseen(angle, plain, now, held, told_by)


def _unseen(angle: float, plain: np.ndarray, now: np.ndarray, held: np.ndarray | None, file: str) -> Check:
    """Where what judges is foretold badly the base is one of many things that may be wrong. (Of a KR 300 with
    a row of its table or a position's time wrong nothing but the base was told.)"""
    turned, controlled = f"gravity turned by {angle:.0f} degrees", "what a controller adds to carry the arm"
    if held is not None and gain(held, plain) > CARRIED:
        return Check(
            "poor_excitation",
            (),
            f"what is fitted (errors of {span(plain)}) foretells the recordings that judge badly "
            f"({span(held)}): the motion does not show what they ask for, not even how the base is mounted "
            f"(with {turned} as much is explained), or a signal or the robot file is not as it is told",
            "fit more of the recordings, or a motion that moves all joints more; check columns, the robot "
            f"file and its gravity, and that torques are not logged less {controlled}",
        )
    return Check(
        "poor_excitation",
        (),
        f"these recordings do not show how the base is mounted: with {turned} the model explains the torques "
        f"about as well (errors of {span(now)}, as told {span(plain)})",
        f"gravity is taken as {file} has it, make sure that it is, and that torques are not logged "
        f"less {controlled}",
    )


def _by_validate(identify: Parts, validate: Parts | None, assumed: np.ndarray, size: float) -> list[Carried]:
    """Gravity along an axis of the base where the fitted motion is too poor to tell and the other recordings
    do: those that are fitted keep their error or lose some, the others lose most of theirs. Best first."""
    plain, held = errors(identify, validate, assumed)
    if validate is None or held is None:
        return []
    told = []
    for k in range(3):
        for sign in (-1.0, 1.0):
            axis = sign * size * np.eye(3)[k]
            now, after = errors(identify, validate, axis)
            value = carried(plain, now, held, after)
            if value > CARRIED and (angle := degrees_between(assumed, axis)) > LEAST_ANGLE:
                told.append(Carried(value, f"gravity turned by {angle:.0f} degrees", axis))
    return sorted(told, key=lambda its: -its.gain)


def _asked(whole: Parts, pieces: Sequence[Parts], assumed: np.ndarray, g: np.ndarray) -> bool:
    """Whether one fit of all recordings contradicts itself with the gravity that is assumed, by what is left
    of each piece of them. (Of five seconds of a KR 300 with a torque of five times its size the base was
    turned over: with no other gravity were the two recordings explained better together.)"""
    gains = [gain(*(errors(whole, piece, way)[1] for way in (assumed, g))) for piece in pieces]
    return beyond_chance(np.array(gains), ODD / AXES)
