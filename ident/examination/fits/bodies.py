"""Fits with every body's own parameters, for gravities and tables other than the robot file's.

The standard parameters' regressor is evaluated as it stands in modelgen (Newton-Euler on arrays), gravity
taken apart: tau = (W_0 + g_x W_x + g_y W_y + g_z W_z) chi. For a given g the best chi is a small solution of
normal equations that are combined from sixteen blocks made once (variable projection). Other tables cost a
new regressor each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import groupby
from typing import Any

import numpy as np

from ident.equations.columns import Columns
from ident.examination.fits.quick import Assignment, Quick, gain_of, quick_of
from ident.examination.fits.samples import Sample
from modelgen.geometry.names import INERTIAL, ParameterName

SAMPLES = 260
AS_OTHERS, ENOUGH = 1.7, 0.15  # what agrees leaves the usual error times this, or this
RIDGE = 1e-9
TOGETHER = 2400  # samples whose regressors are evaluated at once: arrays that a core's cache holds


@dataclass(frozen=True, slots=True)
class Parts:
    """Per channel, of W_0 and own columns, W_x, W_y, W_z: the columns (k,) of p that are not zero in it,
    G (4, 4, k, k), v (4, k), yy."""

    p: int
    columns: tuple[np.ndarray, ...]
    G: tuple[np.ndarray, ...]
    v: tuple[np.ndarray, ...]
    yy: np.ndarray  # (C,)

    def without(self, channels: np.ndarray) -> Parts:
        """Without these channels (C,) bool: as if nothing of them were seen."""
        return replace(self, yy=np.where(channels, 0.0, self.yy))

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
    thin = _thin(samples, most)
    if thin is None:
        return None
    made = [standard(table, s.q[thin], s.dq[thin], s.ddq[thin], free) for s in samples]
    return _summed(columns, samples, how, thin, made)


def parts_with_gravity_of(
    its: Sample, table: Any, columns: Columns, samples: Sequence[Sample], how: Assignment, most: int = SAMPLES
) -> Parts:
    """Blocks with gravity taken apart in one of the samples alone; the others have the table's own."""
    thin = _thin(samples, most)
    assert thin is not None
    made = []
    for s in samples:
        W = standard(table, s.q[thin], s.dq[thin], s.ddq[thin], free=s is its)
        made.append(W if s is its else np.concatenate([W, np.zeros((3, *W.shape[1:]))]))
    return _summed(columns, samples, how, thin, made)


def parts_of_each(
    tables: Sequence[Any], columns: Columns, samples: Sequence[Sample], how: Assignment, most: int = SAMPLES
) -> Iterator[Parts]:
    """Those of several tables, each with its own gravity. Of 60 tables and 160 samples nearly all of the time
    is that of calls, not of numbers: some tables together take a third of it."""
    thin = _thin(samples, most)
    assert thin is not None
    for some in _alike(tables, max(1, TOGETHER // sum(len(s.q[thin]) for s in samples))):
        made = [_standard_of_each(some, s.q[thin], s.dq[thin], s.ddq[thin]) for s in samples]
        for its in zip(*made):
            yield _summed(columns, samples, how, thin, its)


def _thin(samples: Sequence[Sample], most: int) -> slice | None:
    """So that some `most` remain of all; None: there is none."""
    total = sum(len(s.q) for s in samples)
    return slice(None, None, max(1, total // most)) if total else None


def _summed(
    columns: Columns, samples: Sequence[Sample], how: Assignment, thin: slice, made: Sequence[np.ndarray]
) -> Parts:
    """made: of the thinned samples of each recording (K, n, N, 10 L)."""
    own, K, bodies = own_columns(columns), made[0].shape[0], made[0].shape[-1]
    p, C = bodies + len(own), len(columns.channels)
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


def with_bodies(table: Any, quick: Quick, zeros: Any = 0.0) -> Quick:
    """The recordings with every body of a table, with its gravity, in the place of base parameters; positions
    zeros (n,) rad on."""
    columns, own = quick.columns, own_columns(quick.columns)
    samples = []
    for s in quick.samples:
        bodies = standard(table, s.q + zeros, s.dq, s.ddq, False)[0][columns.joint_of]
        samples.append(replace(s, W=np.concatenate([bodies, s.W[:, :, own]], axis=2)))
    return quick_of(columns, samples)


def own_columns(columns: Columns) -> np.ndarray:
    """Parameters that are no body's: friction, rotors, offsets, drives; a payload's are left to bodies."""
    kinds = [ParameterName.of(name) for name in columns.parameters]
    return np.array([k for k, kind in enumerate(kinds) if kind is None or kind.kind not in INERTIAL], int)


def standard(table: Any, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, free: bool = True) -> np.ndarray:
    """(4, n, N, 10 L): W_0 without gravity, then by each component of gravity, of every body's parameters;
    (1, n, N, 10 L) with the table's gravity where it is not free."""
    if not free:
        return np.asarray(_standard_of_each([table], q, dq, ddq)[0])
    from modelgen.dynamics.newton_euler import regressor_of_samples
    from modelgen.geometry.kinematics import State

    n, N = q.shape[1], len(q)
    out = []
    shift = _constant_angles(table)
    c, s = np.cos(q + shift), np.sin(q + shift)
    for part in range(4):
        gravity = tuple(1.0 if part == k + 1 else 0 for k in range(3))
        rest = (0,) * n  # structural zeros, which nothing is multiplied with
        motion = (tuple(dq.T), tuple(ddq.T)) if part == 0 else (rest, rest)
        state = State(tuple(c.T), tuple(s.T), tuple(q.T), *motion)
        out.append(regressor_of_samples(replace(table, gravity=gravity), state, N))
    return np.array(out).swapaxes(2, 3)


def _alike(tables: Sequence[Any], most: int) -> Iterator[list[Any]]:
    """Neighbouring ones whose rows stand on the same ones and move alike, so many at most."""
    for _, its in groupby(tables, lambda table: [(row.antecedent, row.sigma) for row in table.rows]):
        alike = list(its)
        yield from (alike[k : k + most] for k in range(0, len(alike), most))


def _standard_of_each(tables: Sequence[Any], q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(T, 1, n, N, 10 L), `standard` of tables that are alike: entries in which they differ are arrays."""
    from modelgen.dynamics.newton_euler import regressor_of_samples
    from modelgen.geometry.kinematics import Geometry, Row, State

    T, N = len(tables), len(q)

    def together(values: Sequence[Any]) -> Any:
        one = values[0]
        if all(type(value) is type(one) and value == one for value in values):
            return one
        return np.repeat(np.array(values, float), N)

    def of_rows(rows: Sequence[Row]) -> Row:
        numbers = (together([getattr(row, f.name) for row in rows]) for f in fields(Row)[2:])
        return Row(rows[0].antecedent, rows[0].sigma, *numbers)

    rows = tuple(of_rows(its) for its in zip(*(table.rows for table in tables)))
    x, y, z = (together(its) for its in zip(*(table.gravity for table in tables)))
    angle = np.concatenate([q + _constant_angles(table) for table in tables])
    q, dq, ddq = (np.tile(its, (T, 1)) for its in (q, dq, ddq))
    state = State(tuple(np.cos(angle).T), tuple(np.sin(angle).T), tuple(q.T), tuple(dq.T), tuple(ddq.T))
    made = regressor_of_samples(Geometry(rows, (x, y, z)), state, T * N)
    return made.reshape(*made.shape[:2], T, N).transpose(2, 0, 3, 1)[:, None]


def torques(table: Any, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, bodies: np.ndarray) -> np.ndarray:
    """(n, N): what bodies (10 L,), in the order of `standard`, ask for with the table's gravity."""
    from modelgen.dynamics.newton_euler import torque
    from modelgen.geometry.kinematics import State

    shift = _constant_angles(table)
    state = State(
        tuple(np.cos(q + shift).T), tuple(np.sin(q + shift).T), tuple(q.T), tuple(dq.T), tuple(ddq.T)
    )
    names = [(j, kind) for j in range(1, len(table.rows) + 1) for kind in INERTIAL]
    made = torque(table, state, dict(zip(names, bodies.tolist())))
    return np.array([np.broadcast_to(np.asarray(value, float), len(q)) for value in made])


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


def beyond_own(error: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(C,) bool: whether one set of bodies leaves more of a torque, error (C,), than bodies of its own, own
    (C,), do: what makes one robot of the torques makes it of all. (Of a Franka on a wall with a torque turned
    a base was told that is 14 degrees off.)"""
    return np.asarray(error > np.fmax(AS_OTHERS * own, ENOUGH))


def by_own(parts: Parts, g: np.ndarray) -> np.ndarray:
    """(C,) errors of the torques with gravity g (3,), each with bodies of its own."""
    its = zip(parts.columns, parts.G, parts.v, parts.yy)
    each = [Parts(parts.p, (columns,), (G,), (v,), np.array([yy])) for columns, G, v, yy in its]
    return np.array([errors(one, None, g)[0][0] for one in each])


def _relative(parts: Parts, G: Sequence[np.ndarray], v: Sequence[np.ndarray], chi: np.ndarray) -> np.ndarray:
    own = [chi[live] for live in parts.columns]
    left = np.array([y - 2 * b @ x + x @ A @ x for y, b, A, x in zip(parts.yy, v, G, own)])
    seen = parts.yy > 0
    return np.where(seen, np.sqrt(np.maximum(left, 0.0) / np.where(seen, parts.yy, 1.0)), np.nan)


def gain(before: np.ndarray | None, after: np.ndarray | None) -> float:
    """Sum of ln(before / after) over the channels."""
    if before is None or after is None:
        return np.inf
    return gain_of(before, after)
