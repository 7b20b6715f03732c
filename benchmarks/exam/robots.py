"""Robots of the exam: MDH tables typed by hand, random chains, Pinocchio models, random physical links.

Nothing here is shared with the packages under examination; the only common ground is contract 1 (the robot
file) and Khalil's convention T(a(j), j) = Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Tz(r).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

HALF = np.pi / 2
GRAVITY = np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True, slots=True)
class Row:
    """One moving row of an MDH table: constant parts only, angles rad, lengths m."""

    prismatic: bool
    alpha: float
    d: float
    theta: float
    r: float


@dataclass(frozen=True, slots=True)
class ExamRobot:
    """A serial robot; ``builtin`` is the name a study uses, or None when a robot file must be written."""

    name: str
    rows: tuple[Row, ...]
    mass: float
    builtin: bool

    @property
    def n(self) -> int:
        return len(self.rows)


def _rows(table: list[tuple[float, float, float, float]]) -> tuple[Row, ...]:
    return tuple(Row(False, *entry) for entry in table)


BUILTIN = (
    ExamRobot(
        "kuka_lwr4p",  # Jubien, Gautier, Janot: table I
        _rows(
            [
                (0, 0, 0, 0),
                (HALF, 0, 0, 0),
                (-HALF, 0, 0, 0.4),
                (-HALF, 0, 0, 0),
                (HALF, 0, 0, 0.39),
                (HALF, 0, 0, 0),
                (-HALF, 0, 0, 0),
            ]
        ),
        16.0,
        True,
    ),
    ExamRobot(
        "ur10e",
        _rows(
            [
                (0, 0, 0, 0.1807),
                (HALF, 0, 0, 0),
                (0, -0.6127, 0, 0),
                (0, -0.57155, 0, 0.17415),
                (HALF, 0, 0, 0.11985),
                (-HALF, 0, 0, 0.11655),
            ]
        ),
        30.0,
        True,
    ),
    ExamRobot(
        "franka_panda",
        _rows(
            [
                (0, 0, 0, 0.333),
                (-HALF, 0, 0, 0),
                (HALF, 0, 0, 0.316),
                (HALF, 0.0825, 0, 0),
                (-HALF, -0.0825, 0, 0.384),
                (HALF, 0, 0, 0),
                (HALF, 0.088, 0, 0),
            ]
        ),
        17.0,
        True,
    ),
    ExamRobot(
        "staubli_tx40",
        _rows(
            [
                (0, 0, 0, 0.32),
                (-HALF, 0, -HALF, 0),
                (0, 0.225, HALF, 0.035),
                (HALF, 0, 0, 0.225),
                (-HALF, 0, 0, 0),
                (HALF, 0, np.pi, 0),
            ]
        ),
        22.0,
        True,
    ),
    ExamRobot(
        "rokae_xmate3pro",
        _rows(
            [
                (0, 0, 0, 0.3415),
                (-HALF, 0, 0, 0),
                (HALF, 0, 0, 0.394),
                (-HALF, 0, 0, 0),
                (HALF, 0, 0, 0.366),
                (-HALF, 0, 0, 0),
                (HALF, 0, 0, 0.2503),
            ]
        ),
        20.0,
        True,
    ),
)


def random_robot(number: int) -> ExamRobot:
    """Chain number 0..5 of the pool: 4 to 6 joints, every second one with a prismatic joint."""
    rng = np.random.default_rng(77_000 + number)
    n = (4, 5, 6, 4, 5, 6)[number % 6]
    slider = int(rng.integers(1, n - 1)) if number % 2 else None
    rows: list[Row] = []
    for j in range(n):
        turned = j > 0 and (rng.random() < 0.7 or rows[-1].alpha == 0.0)
        alpha = float(rng.choice([-HALF, HALF])) if turned else 0.0
        d = 0.0 if j == 0 else float(rng.choice([0.0, 0.0, round(rng.uniform(0.08, 0.45), 3)]))
        if alpha == 0.0 and j > 0 and d == 0.0:
            d = round(float(rng.uniform(0.15, 0.4)), 3)
        r = round(float(rng.uniform(0.1, 0.4)), 3) if rng.random() < 0.5 else 0.0
        theta = float(rng.choice([0.0, 0.0, HALF])) if j else 0.0
        rows.append(Row(j == slider, alpha, d, theta, r))
    return ExamRobot(f"exam_chain_{number}", tuple(rows), float(round(rng.uniform(8, 30), 1)), False)


def _angle(value: float) -> str:
    quarter = round(value / HALF)
    return {0: "0", 1: "pi/2", -1: "-pi/2", 2: "pi", -2: "-pi"}[quarter]


def write_robot_file(robot: ExamRobot, path: Path) -> None:
    """The robot as contract 1 wants it."""
    lines = [f"name: {robot.name}", "convention: mdh", "gravity: [0, 0, -9.81]", "links:"]
    for j, row in enumerate(robot.rows, start=1):
        theta, r = _angle(row.theta), f"{row.r:g}"
        if row.prismatic:
            r = f"q{j} + {r}" if row.r else f"q{j}"
        else:
            theta = f"q{j} + {theta}" if row.theta > 0 else f"q{j}" if row.theta == 0 else f"q{j} {theta}"
        kind = "prismatic" if row.prismatic else "revolute"
        lines.append(
            f"  - {{joint: {kind}, antecedent: {j - 1}, alpha: {_angle(row.alpha)}, d: {row.d:g}, "
            f"theta: {theta}, r: {r}}}"
        )
    path.write_text("\n".join(lines) + "\n")


def placement(row: Row) -> pin.SE3:
    """Constant part of a row; the joint then turns about (or slides along) the new z."""

    def rotation(axis: int, angle: float) -> np.ndarray:
        unit = np.zeros(3)
        unit[axis] = 1.0
        return pin.AngleAxis(angle, unit).matrix()

    along_x = pin.SE3(rotation(0, row.alpha), np.array([row.d, 0.0, 0.0]))
    return along_x * pin.SE3(rotation(2, row.theta), np.array([0.0, 0.0, row.r]))


def random_links(robot: ExamRobot, rng: np.random.Generator) -> list[pin.Inertia]:
    """Links of scattered balls between a joint and the next one: every inertia is that of a real body."""
    shares = np.linspace(1.0, 0.25, robot.n) * rng.uniform(0.6, 1.4, robot.n)
    masses = robot.mass * shares / shares.sum()
    links = []
    for j in range(robot.n):
        tip = placement(robot.rows[j + 1]).translation if j + 1 < robot.n else np.array([0.0, 0.0, 0.08])
        if np.linalg.norm(tip) < 0.05:
            tip = tip + rng.normal(0, 0.05, 3)
        body = pin.Inertia.Zero()
        for _ in range(6):
            centre = tip * rng.uniform(0.0, 0.9) + rng.normal(0, 0.03, 3)
            body = body + pin.Inertia.FromSphere(masses[j] / 6, 0.04).se3Action(
                pin.SE3(np.eye(3), np.asarray(centre, dtype=float))
            )
        links.append(body)
    return links


def pinocchio_model(robot: ExamRobot, links: list[pin.Inertia]) -> pin.Model:
    """Pinocchio's model of the chain with the given link inertias."""
    model = pin.Model()
    model.gravity.linear = GRAVITY
    parent = 0
    for j, row in enumerate(robot.rows):
        joint = pin.JointModelPZ() if row.prismatic else pin.JointModelRZ()
        parent = model.addJoint(parent, joint, placement(row), f"joint{j + 1}")
        model.appendBodyToJoint(parent, links[j], pin.SE3.Identity())
    return model


def inverse_dynamics(model: pin.Model, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """Link torque (N, n) of the rigid tree: Pinocchio's RNEA sample by sample."""
    data, tau = model.createData(), np.empty_like(q)
    rnea = pin.rnea
    for i in range(len(q)):
        tau[i] = rnea(model, data, q[i], dq[i], ddq[i])
    return tau


def regressor(model: pin.Model, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n, 10 n) regressor of the link inertial parameters, from Pinocchio."""
    data = model.createData()
    W = np.empty((len(q), model.nv, 10 * model.nv))
    for i in range(len(q)):
        W[i] = pin.computeJointTorqueRegressor(model, data, q[i], dq[i], ddq[i])
    return W


def tip_jacobian(model: pin.Model, robot: ExamRobot, q: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(N, 3, n): velocity of a point of the last link, base axes, per joint rate."""
    data = model.createData()
    frame = (
        model.addFrame(pin.Frame("tip", robot.n, 0, pin.SE3(np.eye(3), point), pin.FrameType.OP_FRAME))
        if not model.existFrame("tip")
        else model.getFrameId("tip")
    )
    data = model.createData()
    J = np.empty((len(q), 3, model.nv))
    for i in range(len(q)):
        J[i] = pin.computeFrameJacobian(model, data, q[i], frame, pin.LOCAL_WORLD_ALIGNED)[:3]
    return J
