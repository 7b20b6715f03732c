"""Torques of the effects that act on the whole arm: contact forces, tilted gravity, bodies picked up.

Each function gives the (N, n) joint torques that one linear parameter adds to the link side, so a tau_m and a
tau_l both carry it. A payload's ten columns are those of the generated model with a payload, times the gate.
"""

from collections.abc import Mapping

import numpy as np

from modelgen.dynamics.newton_euler import INERTIAL, motions, regressor, unit_wrench
from modelgen.effects.frames import Frames, frames
from modelgen.geometry.kinematics import geometry, state
from modelgen.geometry.names import ParameterName
from modelgen.geometry.robot import Robot

Array = np.ndarray


def gate(t: Array, start: float | None = None, stop: float | None = None) -> Array:
    """(N,) 1 where start <= t < stop, else 0; None is open. t in s since the first sample."""
    inside = np.ones(len(t), dtype=bool)
    if start is not None:
        inside &= t >= start
    if stop is not None:
        inside &= t < stop
    return inside.astype(float)


def force_columns(
    robot: Robot, q: Array, row: int | None = None, point: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Array:
    """(N, n, 6) columns J^T of a wrench (FX FY FZ NX NY NZ), base axes, at a point [m] of a row's frame.

    By default the origin of the last moving row. Unit: N m per N and per N m (revolute), N per N (prismatic).
    """
    arm = frames(robot, q)
    last = max(j for j, k in enumerate(arm.joint) if k >= 0) if row is None else row
    place = arm.p[:, last] + arm.R[:, last] @ np.asarray(point, dtype=float)
    columns = np.zeros((len(q), arm.n, 6))
    for j in arm.above(last):
        if arm.joint[j] < 0:
            continue
        z = arm.R[:, j, :, 2]
        if arm.sigma[j] == 0:
            columns[:, arm.joint[j], :3] = np.cross(z, place - arm.p[:, j])
            columns[:, arm.joint[j], 3:] = z
        else:
            columns[:, arm.joint[j], :3] = z
    return columns


def gravity_torque(robot: Robot, q: Array, standard: Mapping[str, float], gravity: Array) -> Array:
    """(N, n) torques that hold the arm against `gravity` (3,) [m/s^2, base axes].

    `standard` maps MXj MYj MZj Mj to values, absent ones are 0; a payload fixed to the last row
    is part of that row. Base parameters may be given under the name of the column they keep, for gravity
    as in the robot file; under a turned gravity the first moments of link 1, which they leave out, may
    matter too.
    """
    return weights(robot, q, standard) @ np.asarray(gravity, dtype=float)


def weights(robot: Robot, q: Array, standard: Mapping[str, float]) -> Array:
    """(N, n, 3) that `gravity_torque` has of a unit gravity along each base axis."""
    return _weights(frames(robot, q), standard)


def _weights(arm: Frames, standard: Mapping[str, float]) -> Array:
    """Weight beyond a joint as one body: first moment about the base's origin and mass."""
    N, L = len(arm.p), len(arm.joint)
    moment, mass, there = np.zeros((L, N, 3)), np.zeros(L), np.zeros(L, bool)
    for row in reversed(range(L)):
        m = standard.get(f"M{row + 1}", 0.0)
        first = np.array([standard.get(f"M{axis}{row + 1}", 0.0) for axis in "XYZ"])
        if m != 0.0 or first.any():
            moment[row] += arm.R[:, row] @ first + m * arm.p[:, row]
            mass[row] += m
            there[row] = True
        before = arm.antecedent[row] - 1
        if before >= 0 and there[row]:
            moment[before] += moment[row]
            mass[before] += mass[row]
            there[before] = True
    tau = np.zeros((N, arm.n, 3))
    for row in range(L):
        if arm.joint[row] < 0 or not there[row]:
            continue
        z = arm.R[:, row, :, 2]
        if arm.sigma[row] == 0:
            tau[:, arm.joint[row]] = np.cross(moment[row] - mass[row] * arm.p[:, row], z)
        else:
            tau[:, arm.joint[row]] = -mass[row] * z
    return tau


def tilted(gravity: Array, roll: float, pitch: float) -> Array:
    """(3,) (Ry(pitch) Rx(roll))^T g: gravity in the axes of a base that is rolled and pitched.

    x and y are the base's own for a gravity along z, else the two axes of :func:`across`.
    """
    g = np.asarray(gravity, dtype=float)
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    Rx = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    Ry = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    A = across(g)
    return A @ (Ry @ Rx).T @ A.T @ g


def across(gravity: Array) -> Array:
    """(3, 3) rotation whose third column lies along +-g; its first two are the axes of roll and pitch.

    For a gravity along z the identity, along x (y) the columns y, z, x (z, x, y); for an oblique one these,
    made perpendicular to it. Small angles always turn gravity and every direction can be reached.
    """
    size = np.linalg.norm(gravity)
    if size == 0:
        return np.eye(3)
    main = int(np.argmax(np.abs(gravity)))
    third = gravity / size * np.sign(gravity[main])
    first = np.eye(3)[(main + 1) % 3]
    first = first - third * (third @ first)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(third, first), third], axis=1)


def tilt_of(gravity: Array, found: Array) -> tuple[float, float]:
    """(roll, pitch) with tilted(gravity, roll, pitch) along `found`; the inverse of `tilted`.

    In the axes of `across` g = (0, 0, -G) and g' = G (sin p, -sin r cos p, -cos r cos p).
    """
    g, found = np.asarray(gravity, dtype=float), np.asarray(found, dtype=float)
    A = across(g)
    x, y, z = A.T @ found / np.linalg.norm(found) * -np.sign((A.T @ g)[2])
    return float(np.arctan2(-y, -z)), float(np.arcsin(np.clip(x, -1.0, 1.0)))


def tilt_torque(robot: Robot, q: Array, standard: Mapping[str, float], roll: float, pitch: float) -> Array:
    """(N, n) torques that a tilt adds: holding against the turned gravity less holding against the file's."""
    g = np.array([float(robot.value(x)) for x in robot.gravity])
    return weights(robot, q, standard) @ (tilted(g, roll, pitch) - g)


def body_columns(robot: Robot, q: Array, dq: Array, ddq: Array, row: int, kinds: tuple[str, ...]) -> Array:
    """(N, n, len(kinds)) torques of unit inertial parameters ("M", "MX", "XX", ...) of a body on `row`, from
    1.

    The standard regressor's columns of that row, gravity as the robot has it.
    """
    columns = regressor(geometry(robot), state(robot, q, dq, ddq), [(row, kind) for kind in kinds])
    out = np.zeros((len(q), robot.n, len(kinds)))
    for k, kind in enumerate(kinds):
        for joint, torque in enumerate(columns[row, kind]):
            out[:, joint, k] = torque
    return out


def arm_length(robot: Robot) -> float:
    """m from joint to joint along the arm, slides pushed in, all of its branches."""
    steps = [(link.b, link.d, link.r) for link in robot.links]
    return sum(float(np.linalg.norm([float(robot.value(x)) for x in step])) for step in steps)


def joint_moments(
    robot: Robot, q: Array, dq: Array, ddq: Array, standard: Mapping[str, float], row: int
) -> Array:
    """(N, 3) moment [N m] that joint `row` (from 1) passes on to its link, in the link's frame and about its
    origin, bending (x, y) and torque (z): the inward Newton-Euler recursion without its projection."""
    shape = geometry(robot)
    frames_of = motions(shape, state(robot, q, dq, ddq))
    forces = [np.zeros((3, len(q))) for _ in frames_of]
    moments = [np.zeros((3, len(q))) for _ in frames_of]
    for j in range(len(frames_of) - 1, row - 2, -1):
        T, motion = frames_of[j]
        for kind in INERTIAL:
            value = standard.get(f"{kind}{j + 1}", 0.0)
            if value:
                f, n = unit_wrench(kind, motion)
                for axis in range(3):
                    forces[j][axis] += value * f[axis]
                    moments[j][axis] += value * n[axis]
        a = T.row.antecedent
        if a >= 0 and j >= row:
            force, moment = (
                np.array([x + np.zeros(len(q)) for x in T.to_antecedent((v[0], v[1], v[2]))])
                for v in (forces[j], moments[j])
            )
            lever = np.array([x + np.zeros(len(q)) for x in T.p])
            forces[a] += force
            moments[a] += moment + np.cross(lever, force, axis=0)
    return moments[row - 1].T


def independent(columns: Array, tolerance: float = 1e-7) -> list[int]:
    """Numbers of the columns of (r, p) that are not a combination of those before them."""
    kept: list[int] = []
    basis = np.zeros((columns.shape[0], 0))
    scale = np.linalg.norm(columns, axis=0).max(initial=0.0)
    for k in range(columns.shape[1]):
        rest = columns[:, k]
        size = np.linalg.norm(rest)
        for _ in range(2):
            rest = rest - basis @ (basis.T @ rest)
        left = np.linalg.norm(rest)
        if size > tolerance * scale and left > tolerance * size:
            basis = np.column_stack([basis, rest / left])
            kept.append(k)
    return kept


def some_motion(robot: Robot, samples: int = 80) -> tuple[Array, Array, Array]:
    """Random states that move every joint: what a structural question is asked at."""
    rng = np.random.default_rng(0)
    return rng.uniform(-1.5, 1.5, (samples, robot.n)), *rng.normal(size=(2, samples, robot.n))  # type: ignore[return-value]


def gravity_columns(robot: Robot, q: Array, gravity: Array, names: tuple[str, ...]) -> Array:
    """(N, n, len(names)) torques of single first moments or masses ("MX1", "M3") under `gravity`.

    What a tilt brings in beside the known parameters: MX1 and MY1 of an upright first axis.
    """
    return _weights_apart(frames(robot, q), np.asarray(gravity, dtype=float), names)


def unit_weights(robot: Robot, q: Array, names: tuple[str, ...]) -> Array:
    """(N, n, len(names), 3) that `gravity_columns` has of a unit gravity along each base axis."""
    arm = frames(robot, q)
    return np.stack([_weights_apart(arm, g, names) for g in np.eye(3)], axis=3)


def _weights_apart(arm: Frames, g: Array, names: tuple[str, ...]) -> Array:
    """A first moment m beyond a turning joint about z weighs (m x z) g = m (z x g) there: that product is
    made once for each joint, and the axes of each link turn it. (Made of one name after the other, bodies
    and all, they took most of the last fit of an arm of five joints.)"""
    out = np.zeros((len(arm.p), arm.n, len(names)))
    read = [ParameterName.of(name) for name in names]
    bodies = [(its.kind, int(its.label) - 1) for its in read if its is not None]
    turning = {j: np.cross(arm.R[:, j, :, 2], g) for j, sigma in enumerate(arm.sigma) if sigma == 0}
    for row in {row for _, row in bodies}:
        for j in (j for j in arm.above(row) if arm.joint[j] >= 0):
            torque = {"M": -arm.R[:, j, :, 2] @ g}
            if j in turning:
                torque = dict(zip(("MX", "MY", "MZ"), np.einsum("nia,ni->an", arm.R[:, row], turning[j])))
                torque["M"] = np.einsum("ni,ni->n", arm.p[:, row] - arm.p[:, j], turning[j])
            for k, (kind, its) in enumerate(bodies):
                if its == row and kind in torque:
                    out[:, arm.joint[j], k] = torque[kind]
    return out
