"""Whether gravity is where the robot file says.

It is sought over the whole sphere, and then in its size, where accelerations fix one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ident.examination.bodies import RIDGE, Parts, contradicted, errors, gain
from ident.examination.carried import CARRIED, Carried, ambiguous, carried, span
from ident.examination.check import Check, listed
from ident.examination.hypothesis import BAD, Hypothesis, explains
from ident.examination.quick import Assignment
from ident.examination.stretches import ODD, beyond_chance

AXES = 6  # of a base
CLEARLY = 1.0  # gain, summed over the channels, on identify; half of it on validate
DIRECTIONS = 120
UNSEEN = 0.5  # gain of the gravity that is assumed over another, below which neither is known
LEAST_ANGLE = 8.0  # degrees; smaller tilts are the diagnosis's effect base_tilt
ROUND_ANGLE = 4.0  # within it an axis of the base is meant


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
) -> Iterator[Hypothesis | Tilt]:
    """Gravity in any direction, and of any size where accelerations show it; assumed (3,) is the file's.
    rivals: the other faults with which the model would predict validate; None where a fault is known already.
    stretches: all that fits and judges, as one and in pieces. names (C,) of the signals; aside: channels that
    are not taken, as with the gravity that all tell they contradict the others.
    What the fitted recordings do not show, validate tells only if none of them predicts it about as well. A
    small tilt has no check (of an AIRBOT tilted by 6 degrees it was told
    that it hangs the other way round)."""
    size = float(np.linalg.norm(assumed)) or 9.81
    plain, held = errors(identify, validate, assumed)

    def score(g: np.ndarray) -> float:
        return gain(plain, errors(identify, None, g, 2)[0])

    left = _coarse(identify, plain)
    starts = sorted((size * d for d in _sphere(DIRECTIONS)), key=left)[:3]
    best = min((_descended(left, g, size) for g in starts), key=left)
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
    small = norm > 0 and _angle(assumed, best) < LEAST_ANGLE and abs(norm / size - 1) < 0.2
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
    before, error = (errors(identify, None, g)[0] for g in (assumed, best))
    beside = contradicted(identify, best, error)
    if beside.any() and aside is None:  # what turns gravity may be a fault of their own
        less = None if validate is None else validate.without(beside)
        its = identify.without(beside)
        of_rest = base_orientation(its, less, assumed, how, names=names, aside=np.flatnonzero(beside))
        yield from (h for h in of_rest if isinstance(h, Hypothesis))
    if beside.any() or not explains(before, error, BAD):  # something else is missing
        return
    if aside is not None:
        where += f" beside {listed([names[c] for c in aside])}, of which something else is wrong,"
    line = f"gravity: [{', '.join(f'{x:.3g}' if abs(x) > 0.005 * size else '0' for x in best)}]"
    angle, norm = _angle(assumed, best), float(np.linalg.norm(best))
    turned = f"turned by {angle:.0f} degrees against the robot file's" if norm else "absent"
    if norm and angle < LEAST_ANGLE:
        turned = f"{norm:.3g} m/s^2, not {size:.4g} as the robot file says"
        why = "its unit is another"
    else:
        why = "the base is mounted otherwise, or its frame is"
    yield Hypothesis(
        value,
        how,
        Check(
            "base_orientation",
            (),
            f"gravity is {turned}: {why}; so taken, the errors of the torques{where} "
            f"fall from {span(plain)} to {span(now)}",
            line,
        ),
    )


def unseen(identify: Parts, validate: Parts | None, assumed: np.ndarray) -> Iterator[Check]:
    """Said where another axis of the base could as well be upright: what few joints feel of gravity, first
    moments make up for, and only their part in the inertia contradicts. A base told wrongly is not named."""
    plain, held = errors(identify, validate, assumed)
    told = []
    for axis in np.linalg.norm(assumed) * np.vstack([np.eye(3), -np.eye(3)]):
        now, after = errors(identify, validate, axis)
        alike = gain(now, plain) < UNSEEN and (held is None or gain(after, held) < UNSEEN)
        if alike and _angle(assumed, axis) > ROUND_ANGLE:
            told.append((_angle(assumed, axis), now))
    if told and np.any(assumed):
        angle, now = max(told, key=lambda its: its[0])
        yield Check(
            "poor_excitation",
            (),
            f"these motions do not show how the base is mounted: with gravity turned by {angle:.0f} degrees "
            f"the model explains the torques about as well (errors of {span(now)}, as told {span(plain)})",
            "gravity is taken as the robot file has it, make sure that it is",
        )


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Degrees between two vectors; 90 where one is zero."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(a @ b / size if size else 0.0, -1, 1))))


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
            if value > CARRIED and (angle := _angle(assumed, axis)) > LEAST_ANGLE:
                told.append(Carried(value, f"gravity turned by {angle:.0f} degrees", axis))
    return sorted(told, key=lambda its: -its.gain)


def _asked(whole: Parts, pieces: Sequence[Parts], assumed: np.ndarray, g: np.ndarray) -> bool:
    """Whether one fit of all recordings contradicts itself with the gravity that is assumed, by what is left
    of each piece of them. (Of five seconds of a KR 300 with a torque of five times its size the base was
    turned over: with no other gravity were the two recordings explained better together.)"""
    gains = [gain(*(errors(whole, piece, way)[1] for way in (assumed, g))) for piece in pieces]
    return beyond_chance(np.array(gains), ODD / AXES)


def _coarse(parts: Parts, error: np.ndarray) -> Callable[[np.ndarray], float]:
    """Sum of squares over all channels, each by what the plain fit leaves of it, as a function of gravity.
    The columns that no gravity moves (inertias, friction) are taken off the others once."""
    scale = np.where(parts.yy > 0, 1 / np.maximum(parts.yy * np.fmax(error, 0.05), 1e-300), 0.0)
    K = parts.G[0].shape[0]
    G, v = np.zeros((K, K, parts.p, parts.p)), np.zeros((K, parts.p))
    for c, live in enumerate(parts.columns):
        G[:, :, live[:, None], live] += scale[c] * parts.G[c]
        v[:, live] += scale[c] * parts.v[c]
    moved = G[1:, 1:].any(axis=(0, 1, 2))
    size, own = _lengths(G[0, 0].diagonal()[~moved])
    still = G[0, 0][~moved][:, ~moved] / np.outer(size, size) + np.diag(own)
    across = G[:, 0, moved][:, :, ~moved] / size  # (K, m, p - m)
    beside = np.vstack([*across, v[0, ~moved] / size])  # (K m + 1, p - m)
    m, off = int(moved.sum()), beside @ np.linalg.solve(still, beside.T)
    left_G = G[:, :, moved][..., moved] - off[:-1, :-1].reshape(K, m, K, m).swapaxes(1, 2)
    left_v, total = v[:, moved] - off[:-1, -1].reshape(K, m), float(scale @ parts.yy - off[-1, -1])
    i, j = np.triu_indices(K)
    both = np.where(i == j, 0.5, 1.0)[:, None, None]
    squares = (both * (G[i, j] + G[j, i])).diagonal(axis1=1, axis2=2)[:, moved]
    flat = (both * (left_G[i, j] + left_G[j, i])).reshape(len(i), -1)

    def left(g: np.ndarray) -> float:
        factor = np.concatenate([[1.0], g])
        pairs = factor[i] * factor[j]
        length, own = _lengths(pairs @ squares)
        normal = (pairs @ flat).reshape(m, m) / length / length[:, None]
        normal.ravel()[:: m + 1] += own
        right = factor @ left_v / length
        return total - float(right @ np.linalg.solve(normal, right))

    return left


def _lengths(squares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of columns, and what stands on the diagonal of their scaled product: a ridge, 1 where nothing is."""
    length = np.sqrt(np.maximum(squares, 1e-300))
    return length, RIDGE + (length <= 1e-140)


def _descended(left: Callable[[np.ndarray], float], g: np.ndarray, size: float) -> np.ndarray:
    """The lowest point of the sphere near g, by a pattern search."""
    value, step = left(g), 0.12 * size
    while step > 0.004 * size:
        u = np.cross(g, np.eye(3)[int(np.argmin(np.abs(g)))])
        u = u / np.linalg.norm(u)
        w = np.cross(g, u) / size
        tries = [g + step * d for d in (u, -u, w, -w, u + w, u - w, -u + w, -u - w)]
        tries = [size * x / np.linalg.norm(x) for x in tries]
        values = [left(x) for x in tries]
        k = int(np.argmin(values))
        if values[k] < value:
            g, value = tries[k], values[k]
        else:
            step /= 2
    return g


def _sphere(count: int) -> np.ndarray:
    """(count + 6, 3) directions: a Fibonacci lattice and the six axes."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - z * z)
    return np.vstack([np.column_stack([r * np.cos(turn), r * np.sin(turn), z]), np.eye(3), -np.eye(3)])
