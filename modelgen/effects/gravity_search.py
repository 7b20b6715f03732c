"""Which direction of gravity explains measured torques, whatever was believed before: a search over the
sphere.

The torque of all standard parameters is linear in gravity, W(g) = W_0 + g_x W_x + g_y W_y + g_z W_z, and
drives do not see it. For each direction the best parameters follow from normal equations that are sums of
products of these four, made once; the direction is refined by halving steps on the sphere.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import sympy as sp

from modelgen.dynamics.newton_euler import regressor
from modelgen.effects.loads import independent, some_motion, unit_weights
from modelgen.effects.place import Motion
from modelgen.geometry.kinematics import geometry, state
from modelgen.geometry.names import GRAVITY, INERTIAL, Channel
from modelgen.geometry.robot import Robot

Array = np.ndarray
INSTANTS = 1500  # of the motions: enough for some hundred parameters
HELD = 3e7  # bytes of columns that are multiplied at once
FINE = 1e-3  # rad: who asks refines it
RIDGE = 1e-9  # of the largest eigenvalue: parameters that no torque shows


def standard_columns(robot: Robot, q: Array, dq: Array, ddq: Array) -> Array:
    """(N, n, 10 rows) torques of every body's standard parameters, gravity as the robot has it."""
    names = [(row, kind) for row in range(1, len(robot.links) + 1) for kind in INERTIAL]
    columns = regressor(geometry(robot), state(robot, q, dq, ddq), names)
    out = np.zeros((len(q), robot.n, len(names)))
    for k, name in enumerate(names):
        for joint, torque in enumerate(columns[name]):
            out[:, joint, k] = torque
    return out


def with_gravity(robot: Robot, g: Sequence[float] | Array) -> Robot:
    """The robot under another gravity."""
    return replace(robot, gravity=tuple(sp.Float(float(x)) if x else sp.Integer(0) for x in g))  # type: ignore[arg-type]


def newly_visible(robot: Robot) -> tuple[str, ...]:
    """First moments and masses, as names, whose columns a general gravity adds to what the file's shows.

    Of an upright arm MX1 and MY1. None may be a parameter that the model has: of the parameters that the
    file's gravity cannot show alone, first those with no column at all.
    """
    motion = some_motion(robot, max(80, 8 * len(robot.links)))
    names = [f"{kind}{row}" for row in range(1, len(robot.links) + 1) for kind in INERTIAL]
    size = float(np.linalg.norm([float(robot.value(x)) for x in robot.gravity])) or 9.81
    other = with_gravity(robot, size * np.array([0.48, -0.6, -0.64]))
    W, V = (standard_columns(r, *motion).reshape(-1, len(names)) for r in (robot, other))
    last_first = list(range(len(names)))[::-1]
    kept = [last_first[i] for i in independent(W[:, last_first])]
    weights = [k for k, name in enumerate(names) if name.rstrip("0123456789") in GRAVITY and k not in kept]
    weights.sort(key=lambda k: float(np.abs(W[:, k]).max()) > 1e-9)
    order = [*kept, *weights]
    added = [order[i] for i in independent(V[:, order]) if i >= len(kept)]
    return tuple(names[k] for k in added)


def directions(
    robot: Robot, channels: Sequence[Channel], motions: Sequence[Motion], size: float, best: int = 2
) -> list[Array]:
    """Up to `best` gravities (3,) [m/s^2, base axes] of that size, the likeliest first."""
    grams = _products(robot, channels, motions)
    start = [np.array(p, dtype=float) for p in _sphere()]
    scored = sorted(((_cost(grams, size * p), i) for i, p in enumerate(start)))
    found: list[tuple[float, Array]] = []
    for _, i in scored[: 3 * best]:
        cost, g = _refined(grams, start[i], size)
        if all(np.dot(g, h) < 0.999 for _, h in found):
            found.append((cost, g))
    found.sort(key=lambda entry: entry[0])
    return [size * g for _, g in found[:best]]


def _sphere() -> list[tuple[float, float, float]]:
    """66 directions: axes, diagonals and a Fibonacci spiral."""
    axes = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]
    k = np.arange(40) + 0.5
    polar, turn = np.arccos(1 - 2 * k / 40), np.pi * (1 + 5**0.5) * k
    spiral = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=1)
    return [tuple(np.array(a) / np.linalg.norm(a)) for a in axes] + [tuple(s) for s in spiral]  # type: ignore[misc]


def _products(
    robot: Robot, channels: Sequence[Channel], motions: Sequence[Motion]
) -> tuple[Array, Array, float]:
    """(4, 4, P, P) products of [W_0, W_x, W_y, W_z], (4, P) with the torque, and its square; every channel in
    units of its own rms."""
    total = sum(len(m.t) for m in motions)
    every = max(1, total // INSTANTS)
    zero = with_gravity(robot, (0.0, 0.0, 0.0))
    names = [f"{kind}{row}" for row in range(1, len(robot.links) + 1) for kind in INERTIAL]
    weights = tuple(name for name in names if name.rstrip("0123456789") in GRAVITY)
    at = [names.index(name) for name in weights]
    wide = len(names) + 4 * len(channels)
    rms = _rms(motions, every)
    most = max(16, int(HELD / (32 * robot.n * wide)))
    gram, moment, square = np.zeros((4, 4, wide, wide)), np.zeros((4, wide)), 0.0
    parts: list[Array] = []
    torques: list[Array] = []

    def added() -> None:
        nonlocal gram, moment, square
        y = (np.concatenate(torques) / rms).ravel()
        flat = (np.concatenate(parts, axis=1) / rms[:, None]).reshape(4, -1, wide)
        gram = gram + np.einsum("arp,brq->abpq", flat, flat, optimize=True)
        moment = moment + np.einsum("arp,r->ap", flat, y)
        square += float(y @ y)
        parts.clear()
        torques.clear()

    begins = [(m, begin) for m in motions for begin in range(0, len(m.t[::every]), most)]
    for m, begin in begins:
        pick = slice(begin * every, (begin + most) * every, every)
        q, dq, ddq, sign = (x[pick] for x in (m.q, m.dq, m.ddq, m.sign_dq))
        assert m.measured is not None
        y = m.measured[pick]
        blocks = np.zeros((4, len(q), robot.n, len(names)))
        blocks[0] = standard_columns(zero, q, dq, ddq)
        blocks[1:, :, :, at] = np.moveaxis(unit_weights(robot, q, weights), 3, 0)
        rows = np.zeros((4, len(q), len(channels), wide))
        for c, channel in enumerate(channels):
            if channel.side != "drive":
                rows[:, :, c, : len(names)] = blocks[:, :, channel.joint]
            own = slice(len(names) + 4 * c, len(names) + 4 * c + 4)
            j = channel.joint
            rows[0, :, c, own] = np.stack([ddq[:, j], dq[:, j], sign[:, j], np.ones(len(q))], axis=1)
        good = np.isfinite(y).all(axis=1)
        parts.append(rows[:, good])
        torques.append(y[good])
        if sum(len(part) for part in torques) >= most:
            added()
    if torques:
        added()
    return gram, moment, square


def _rms(motions: Sequence[Motion], every: int) -> Array:
    """(C,) of the torques that are looked at."""
    torques = []
    for m in motions:
        assert m.measured is not None
        y = m.measured[::every]
        torques.append(y[np.isfinite(y).all(axis=1)])
    return np.maximum(np.sqrt(np.mean(np.concatenate(torques) ** 2, axis=0)), 1e-9)


def _cost(products: tuple[Array, Array, float], g: Array) -> float:
    """Squared residual of the best parameters under this gravity."""
    gram, moment, square = products
    a = np.array([1.0, *g])
    G, b = np.einsum("a,b,abpq->pq", a, a, gram), a @ moment
    scale = np.sqrt(np.maximum(np.diag(G), 1e-12 * np.diag(G).max()))
    values, vectors = np.linalg.eigh(G / np.outer(scale, scale))
    seen = values > RIDGE * values[-1]
    p = vectors[:, seen].T @ (b / scale)
    return square - float(np.sum(p**2 / values[seen]))


def _refined(products: tuple[Array, Array, float], g: Array, size: float) -> tuple[float, Array]:
    """The direction moved downhill on the sphere until steps are below FINE."""
    cost, step = _cost(products, size * g), 0.3
    while step > FINE:
        u = np.linalg.svd(g[None])[2][1:]  # two directions across g
        trials = [g + step * s * e for e in (u[0], u[1], u[0] + u[1], u[0] - u[1]) for s in (1, -1)]
        trials = [t / np.linalg.norm(t) for t in trials]
        costs = [_cost(products, size * t) for t in trials]
        if min(costs) < cost:
            cost, g = min(costs), trials[int(np.argmin(costs))]
        else:
            step /= 3
    return cost, g
