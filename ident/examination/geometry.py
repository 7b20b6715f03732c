"""Whether gravity is where the robot file says, and whether an axis of its table is turned.

The standard parameters' regressor is evaluated as it stands in modelgen (Newton-Euler on arrays), gravity
taken apart: tau = (W_0 + g_x W_x + g_y W_y + g_z W_z) chi. For a given g the best chi is a small solution of
normal equations that are combined from sixteen blocks made once (variable projection), so that gravity can be
sought over the whole sphere, and then in its size, where accelerations fix one. Other tables cost a new
regressor each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from ident.equations.columns import Columns
from ident.examination.check import Check
from ident.examination.quick import CARRIED, Assignment, Carried, Sample, carried, gain_of
from ident.examination.torques import EXPLAINED, Hypothesis
from modelgen.geometry.names import INERTIAL, ParameterName

CLEARLY = 1.0  # gain, summed over the channels, on identify; half of it on validate
SAMPLES = 260
AXES_SAMPLES = 160
DIRECTIONS = 120
UNSEEN = 0.5  # gain of the gravity that is assumed over another, below which neither is known
LEAST_ANGLE = 8.0  # degrees; smaller tilts are the diagnosis's effect base_tilt
ROUND_ANGLE = 4.0  # within it an axis of the base is meant
RIDGE = 1e-9


@dataclass(frozen=True, slots=True)
class Parts:
    """Per channel, of W_0 and own columns, W_x, W_y, W_z: the columns (k,) of p that are not zero in it,
    G (4, 4, k, k), v (4, k), yy."""

    p: int
    columns: tuple[np.ndarray, ...]
    G: tuple[np.ndarray, ...]
    v: tuple[np.ndarray, ...]
    yy: np.ndarray  # (C,)

    def at(self, g: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """G (k, k) and v (k,) of every channel with gravity g (3,)."""
        factor = np.concatenate([[1.0], g]) if self.G[0].shape[0] == 4 else np.ones(1)
        pairs = np.outer(factor, factor)
        return [np.tensordot(pairs, G, 2) for G in self.G], [factor @ v for v in self.v]


def parts_of(
    table: Any,
    columns: Columns,
    samples: Sequence[Sample],
    how: Assignment,
    most: int = SAMPLES,
    free: bool = True,
) -> Parts | None:
    """Blocks of these samples for one MDH table (modelgen's Geometry) and one hypothesis about torques.

    free: gravity taken apart; else the table's own, and one block instead of four.
    """
    own = _own_columns(columns)
    total = sum(len(s.q) for s in samples)
    if not total:
        return None
    stride, K = max(1, total // most), 4 if free else 1
    bodies = 10 * len(table.rows)
    p, C = bodies + len(own), len(columns.channels)
    thin = slice(None, None, stride)
    made = [standard(table, s.q[thin], s.dq[thin], s.ddq[thin], free) for s in samples]
    seen, G, v, yy = [], [], [], np.zeros(C)
    for c in range(C):
        weight = np.concatenate([s.weight[thin, c] for s in samples])
        y = how.factor[c] * np.concatenate([s.Y[thin, how.order[c]] for s in samples])
        wide = np.zeros((K, len(y), p))
        if columns.need.model != "D":
            wide[:, :, :bodies] = np.concatenate([W[:, columns.joint_of[c]] for W in made], axis=1)
        wide[0, :, bodies:] = np.concatenate([s.W[c][thin][:, own] for s in samples])
        live = np.flatnonzero(wide.any(axis=(0, 1)))
        flat = wide[:, :, live].transpose(1, 0, 2).reshape(len(y), K * len(live))
        gram = (flat * weight[:, None]).T @ flat
        seen.append(live)
        G.append(np.ascontiguousarray(gram.reshape(K, len(live), K, len(live)).transpose(0, 2, 1, 3)))
        v.append(((flat * weight[:, None]).T @ y).reshape(K, len(live)))
        yy[c] = weight @ y**2
    return Parts(p, tuple(seen), tuple(G), tuple(v), yy)


def _own_columns(columns: Columns) -> np.ndarray:
    """Parameters that are no body's: friction, rotors, offsets, drives; a payload's are left to bodies."""
    kinds = [ParameterName.of(name) for name in columns.parameters]
    return np.array([k for k, kind in enumerate(kinds) if kind is None or kind.kind not in INERTIAL], int)


def standard(table: Any, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, free: bool = True) -> np.ndarray:
    """(4, n, N, 10 L): W_0 without gravity, then by each component of gravity, of every body's parameters;
    (1, n, N, 10 L) with the table's gravity where it is not free."""
    from modelgen.dynamics.newton_euler import regressor
    from modelgen.geometry.kinematics import State

    wanted = [(j, kind) for j in range(1, len(table.rows) + 1) for kind in INERTIAL]
    n, N = q.shape[1], len(q)
    out = np.zeros((4 if free else 1, n, N, len(wanted)))
    shift = _constant_angles(table)
    c, s = np.cos(q + shift), np.sin(q + shift)
    for part in range(len(out)):
        gravity = tuple(1.0 if part == k + 1 else 0 for k in range(3)) if free else table.gravity
        rest = (0,) * n  # structural zeros, which nothing is multiplied with
        motion = (tuple(dq.T), tuple(ddq.T)) if part == 0 else (rest, rest)
        state = State(tuple(c.T), tuple(s.T), tuple(q.T), *motion)
        made = regressor(replace(table, gravity=gravity), state, wanted)
        for k, column in enumerate(wanted):
            for i, value in enumerate(made[column]):
                out[part, i, :, k] = value
    return out


def _constant_angles(table: Any) -> np.ndarray:
    return np.array([np.arctan2(float(r.s_theta), float(r.c_theta)) for r in table.rows if r.sigma != 2])


def errors(
    identify: Parts, validate: Parts | None, g: np.ndarray, turns: int = 2
) -> tuple[np.ndarray, np.ndarray | None]:
    """Relative errors (C,) of the channels on identify and on validate, with gravity g (3,)."""
    G, v = identify.at(g)
    seen = identify.yy > 0
    scale = np.where(seen, 1.0 / np.maximum(identify.yy, 1e-300), 0.0)
    error = np.ones(len(scale))
    chi = np.zeros(identify.p)
    for _ in range(turns):
        normal, right = np.zeros((identify.p, identify.p)), np.zeros(identify.p)
        for c, live in enumerate(identify.columns):
            normal[np.ix_(live, live)] += scale[c] * G[c]
            right[live] += scale[c] * v[c]
        length = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        normal = normal / np.outer(length, length)
        normal[np.diag_indices_from(normal)] += RIDGE + (length <= 1e-140)
        chi = np.linalg.solve(normal, right / length) / length
        error = _relative(identify, G, v, chi)
        scale = np.where(seen, 1.0 / np.maximum(identify.yy, 1e-300) / np.fmax(error, 0.02) ** 2, 0)
    return error, None if validate is None else _relative(validate, *validate.at(g), chi)


def _relative(parts: Parts, G: Sequence[np.ndarray], v: Sequence[np.ndarray], chi: np.ndarray) -> np.ndarray:
    own = [chi[live] for live in parts.columns]
    left = np.array([y - 2 * b @ x + x @ A @ x for y, b, A, x in zip(parts.yy, v, G, own)])
    return np.where(parts.yy > 0, np.sqrt(np.maximum(left, 0.0) / np.maximum(parts.yy, 1e-300)), np.nan)


def gain(before: np.ndarray | None, after: np.ndarray | None) -> float:
    """Sum of ln(before / after) over the channels."""
    if before is None or after is None:
        return np.inf
    return gain_of(before, after)


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
) -> Iterator[Hypothesis | Tilt]:
    """Gravity in any direction, and of any size where accelerations show it; assumed (3,) is the file's.
    rivals: the other faults with which the model would predict validate; None where a fault is known already.
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
    if np.nanmax(errors(identify, None, best)[0]) > EXPLAINED:  # something else is missing
        return
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
            f"fall from {_span(plain)} to {_span(now)}",
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
            f"the model explains the torques about as well (errors of {_span(now)}, not {_span(plain)})",
            "gravity is taken as the robot file has it, make sure that it is",
        )


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Degrees between two vectors; 90 where one is zero."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(a @ b / size if size else 0.0, -1, 1))))


def ambiguous(held: np.ndarray | None, told: Sequence[Carried]) -> Check:
    """All that would explain recordings that are foretold badly; none is believed."""
    assert held is not None
    words = "; ".join(its.words for its in sorted(told, key=lambda its: -its.gain))
    return Check(
        "poor_excitation",
        (),
        f"what is fitted does not predict the recordings that validate (errors of {_span(held)}), and its "
        f"motions do not show why: {words}: "
        f"{'each of these' if len(told) > 1 else 'this'} alone would predict them far better",
        "check each of them, and record a motion that moves all joints more",
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
            if value > CARRIED and (angle := _angle(assumed, axis)) > LEAST_ANGLE:
                told.append(Carried(value, f"gravity turned by {angle:.0f} degrees", axis))
    return sorted(told, key=lambda its: -its.gain)


def _coarse(parts: Parts, error: np.ndarray) -> Callable[[np.ndarray], float]:
    """Sum of squares over all channels, each by what the plain fit leaves of it, as a function of gravity."""
    scale = np.where(parts.yy > 0, 1 / np.maximum(parts.yy * np.fmax(error, 0.05), 1e-300), 0.0)
    K = parts.G[0].shape[0]
    G, v = np.zeros((K, K, parts.p, parts.p)), np.zeros((K, parts.p))
    for c, live in enumerate(parts.columns):
        G[:, :, live[:, None], live] += scale[c] * parts.G[c]
        v[:, live] += scale[c] * parts.v[c]
    total = float(scale @ parts.yy)
    i, j = np.triu_indices(K)
    both = np.where(i == j, 0.5, 1.0)[:, None, None] * (G[i, j] + G[j, i])
    flat = both.reshape(len(i), -1)

    def left(g: np.ndarray) -> float:
        factor = np.concatenate([[1.0], g])
        normal, right = ((factor[i] * factor[j]) @ flat).reshape(parts.p, parts.p), factor @ v
        length = np.sqrt(np.maximum(normal.diagonal(), 1e-300))
        normal /= length
        normal /= length[:, None]
        normal.ravel()[:: parts.p + 1] += RIDGE + (length <= 1e-140)
        right = right / length
        return total - float(right @ np.linalg.solve(normal, right))

    return left


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


def _span(error: np.ndarray) -> str:
    return f"{100 * np.nanmin(error):.0f} to {100 * np.nanmax(error):.0f} %"


def _sphere(count: int) -> np.ndarray:
    """(count + 6, 3) directions: a Fibonacci lattice and the six axes."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - z * z)
    return np.vstack([np.column_stack([r * np.cos(turn), r * np.sin(turn), z]), np.eye(3), -np.eye(3)])


def joint_axes(
    table: Any,
    columns: Columns,
    samples: Sequence[Sample],
    gravity: np.ndarray,
    how: Assignment,
    prior: float = 0.0,
) -> Iterator[Hypothesis]:
    """One entry of the table wrong by a quarter or half turn, or one axis reversed."""
    fitted = [s for s in samples if s.role == "identify"]
    held_out = [s for s in samples if s.role == "validate"]

    def judged(other: Any) -> tuple[np.ndarray, np.ndarray | None]:
        identify = parts_of(other, columns, fitted, how, AXES_SAMPLES, False)
        assert identify is not None
        return errors(identify, parts_of(other, columns, held_out, how, AXES_SAMPLES // 2, False), gravity)

    table = replace(table, gravity=tuple(float(g) for g in gravity))
    plain, held = judged(table)
    found: list[tuple[float, int, str, np.ndarray]] = []
    labels = iter(str(j) for j in columns.need.joints)
    for j, row in enumerate(table.rows):
        label = next(labels) if row.sigma != 2 else ""
        for key, turn in product(("alpha", "theta"), (1, -1, 2)):
            if key == "theta" and row.sigma == 0 and turn == 2 and j == 0:
                continue
            now, after = judged(replace(table, rows=_turned(table.rows, j, key, turn)))
            predicts = after is None or np.nanmax(after) < 1.0
            if gain(plain, now) > CLEARLY and gain(held, after) > 0.5 * CLEARLY and predicts:
                words = {1: "pi/2", -1: "-pi/2", 2: "pi"}[turn]
                text = f"link {j + 1}{f' (joint {label})' if label else ''}: {key} is off by {words}"
                found.append((gain(plain, now), j, f"{text}", now))
    if not found:
        return
    best = max(found, key=lambda item: item[0])
    if best[0] < prior or np.nanmax(best[3]) > EXPLAINED:
        return
    equal = [text for value, _, text, _ in found if value > 0.97 * best[0] and text != best[2]]
    also = f" (or {'; '.join(equal[:3])}, which these data do not tell apart)" if equal else ""
    yield Hypothesis(
        best[0],
        how,
        Check(
            "joint_axis",
            (),
            f"the robot file seems wrong: {best[2]}{also}; so turned, the errors of the torques fall "
            f"from {_span(plain)} "
            f"to {_span(best[3])}",
            "correct the row in the robot file",
        ),
    )


def _turned(rows: tuple[Any, ...], j: int, key: str, quarters: int) -> tuple[Any, ...]:
    c, s = {1: (0, 1), -1: (0, -1), 2: (-1, 0)}[quarters]
    row = rows[j]
    a, b = getattr(row, f"c_{key}"), getattr(row, f"s_{key}")
    new = replace(row, **{f"c_{key}": a * c - b * s, f"s_{key}": b * c + a * s})
    return (*rows[:j], new, *rows[j + 1 :])
