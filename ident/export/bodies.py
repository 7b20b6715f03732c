"""Bodies as pseudo-inertias, and a made prior: what each link would weigh if it were of one density.

The pseudo-inertia of a body is P = [[S, ms], [ms', M]], S = tr(I)/2 - I (modelgen/exact/pseudo_inertia.py);
a body can exist if and only if P is positive definite (Wensing, Kim and Slotine 2018). Where a robot's file
has no inertias, a link is taken as a ball at each of its joints and a tube between them, of one radius and
one density for all links: the density is then fitted, one number, to the recordings.
"""

from __future__ import annotations

import numpy as np

from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.exact.pseudo_inertia import constant_frame, parameters
from modelgen.geometry.kinematics import geometry
from modelgen.geometry.robot import Robot

THICKNESS = 0.25  # radius of a tube over the median distance between joints
THINNEST = 0.02  # m

# (10, 4, 4): P of each of the ten parameters being 1, in the order of INERTIAL
BASIS = np.zeros((10, 4, 4))
for _k, _kind in enumerate(INERTIAL):
    _one = {kind: float(kind == _kind) for kind in INERTIAL}
    _half = (_one["XX"] + _one["YY"] + _one["ZZ"]) / 2
    BASIS[_k] = [
        [_half - _one["XX"], -_one["XY"], -_one["XZ"], _one["MX"]],
        [-_one["XY"], _half - _one["YY"], -_one["YZ"], _one["MY"]],
        [-_one["XZ"], -_one["YZ"], _half - _one["ZZ"], _one["MZ"]],
        [_one["MX"], _one["MY"], _one["MZ"], _one["M"]],
    ]


def body(P: np.ndarray) -> np.ndarray:
    """(10,) standard parameters, in the order of INERTIAL, of a pseudo-inertia (4, 4)."""
    found = parameters(P.tolist())
    return np.array([found[kind] for kind in INERTIAL])


def pseudo(phi: np.ndarray) -> np.ndarray:
    """(4, 4) of standard parameters (10,)."""
    return np.tensordot(phi, BASIS, 1)


def frames(robot: Robot) -> list[np.ndarray]:
    """(4, 4) per row: where its frame is in its antecedent's when its joint variable is zero."""
    table = geometry(robot)
    out = []
    for j, row in enumerate(table.rows):
        turned = np.eye(4)
        if row.sigma == 0:  # constant_frame leaves a revolute joint's own offset to the joint
            turned[:2, :2] = [[row.c_theta, -row.s_theta], [row.s_theta, row.c_theta]]
        out.append(np.array(constant_frame(table, j), float) @ turned)
    return out


def unit_density(robot: Robot) -> np.ndarray:
    """(rows, 4, 4): pseudo-inertia of each link at 1 kg/m^3, in the frame of its MDH row."""
    table = geometry(robot)
    places = frames(robot)
    ends: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in table.rows]
    for j, row in enumerate(table.rows):
        if row.sigma == 0 and row.r:  # the link begins where its axis is met, r below its frame
            ends[j].append((np.array([0.0, 0.0, -float(row.r)]), np.zeros(3)))
        if row.antecedent >= 0:
            reach = places[j][:3, 3] - (float(row.r) * places[j][:3, 2] if row.sigma == 0 else 0.0)
            ends[row.antecedent].append((np.zeros(3), reach))
    lengths = [np.linalg.norm(b - a) for pieces in ends for a, b in pieces]
    lengths = [length for length in lengths if length > 1e-6]
    radius = max(THICKNESS * float(np.median(lengths)) if lengths else 0.0, THINNEST)
    return np.array(
        [sum((_tube(a, b, radius) for a, b in pieces), _ball(np.zeros(3), radius)) for pieces in ends]
    )


def _ball(at: np.ndarray, radius: float) -> np.ndarray:
    return _mass(4 / 3 * np.pi * radius**3, at, radius**2 / 5 * np.eye(3))


def _tube(a: np.ndarray, b: np.ndarray, radius: float) -> np.ndarray:
    """A solid cylinder from a to b with a ball at b."""
    length = float(np.linalg.norm(b - a))
    if length < 1e-6:
        return np.zeros((4, 4))
    along = np.outer(b - a, b - a) / length**2
    spread = length**2 / 12 * along + radius**2 / 4 * (np.eye(3) - along)
    return _mass(np.pi * radius**2 * length, (a + b) / 2, spread) + _ball(b, radius)


def _mass(mass: float, centre: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """P of a mass whose points scatter with covariance `spread` about `centre`."""
    P = np.zeros((4, 4))
    P[:3, :3] = spread + np.outer(centre, centre)
    P[:3, 3] = P[3, :3] = centre
    P[3, 3] = 1.0
    return mass * P


def given_bodies(robot: Robot) -> np.ndarray | None:
    """(rows, 4, 4) of the inertias that a robot's own file gives; None where it gives none.

    What is no body (a massless frame, an inertia that no mass distribution has) gets a hundredth of a made
    one and what it lacks, so that it is one.
    """
    values = robot.standard_values
    total = sum(values.get(f"M{j}", 0.0) for j in range(1, len(robot.links) + 1))
    if total <= 0:
        return None
    made = unit_density(robot)
    made = made * (total / made[:, 3, 3].sum())
    out = []
    for j in range(1, len(robot.links) + 1):
        P = pseudo(np.array([values.get(f"{kind}{j}", 0.0) for kind in INERTIAL]))
        lowest = float(np.linalg.eigvalsh(P)[0])
        if lowest <= 1e-9 * max(np.trace(P), 1e-9):
            P = P + 0.01 * made[j - 1] + max(-lowest, 0.0) * np.eye(4)
        out.append(P)
    return np.array(out)
