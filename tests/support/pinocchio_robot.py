"""A robot file's robot in Pinocchio, an independent program, and its numeric base parameter count."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from modelgen.geometry.robot import Robot

# Pinocchio's order of a body's ten parameters; the inertia is about the joint frame's origin there too.
ORDER = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")
FAMILIES = {"A": ("tau_m",), "B": ("tau_l",), "C": ("tau_m", "tau_l"), "D": ("tau_d",)}


def _placement(robot: Robot, j: int) -> pin.SE3:
    link = robot.link(j)
    gamma, b, alpha, d, theta, r = (
        float(robot.value(x)) for x in (link.gamma, link.b, link.alpha, link.d, link.theta, link.r)
    )

    def screw(axis: int, angle: float, length: float) -> pin.SE3:
        rotation = (pin.utils.rotate("x", angle), None, pin.utils.rotate("z", angle))[axis]
        return pin.SE3(rotation, length * np.eye(3)[axis])

    return screw(2, gamma, b) * screw(0, alpha, d) * screw(2, theta, r)


class PinocchioRobot:
    """The robot with one Pinocchio joint per moving row; fixed rows are offsets of their antecedent."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.model = pin.Model()
        self.model.gravity = pin.Motion(np.array([float(robot.value(g)) for g in robot.gravity]), np.zeros(3))
        self.frames: dict[int, tuple[int, pin.SE3]] = {0: (0, pin.SE3.Identity())}  # row -> joint, placement
        for j, link in enumerate(robot.links, 1):
            joint, place = self.frames[link.antecedent]
            place = place * _placement(robot, j)
            if link.sigma != 2:
                kind = pin.JointModelPZ() if link.sigma else pin.JointModelRZ()
                joint, place = self.model.addJoint(joint, kind, place, f"row{j}"), pin.SE3.Identity()
            self.frames[j] = (joint, place)
        self.data = self.model.createData()
        self.moved = {j: _moved(place) for j, (_, place) in self.frames.items() if j}

    def regressor(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> dict[tuple[int, str], np.ndarray]:
        """Torques (n,) of each (row, parameter) being 1, at one state; Pinocchio's own body regressor."""
        whole = pin.computeJointTorqueRegressor(self.model, self.data, q, dq, ddq).reshape(self.robot.n, -1)
        columns = {}
        for j in range(1, len(self.robot.links) + 1):
            joint, _ = self.frames[j]
            if joint == 0:
                columns.update({(j, kind): np.zeros(self.robot.n) for kind in ORDER})
                continue
            block = whole[:, 10 * (joint - 1) : 10 * joint] @ self.moved[j]
            columns.update({(j, kind): block[:, k] for k, kind in enumerate(ORDER)})
        return columns

    def torque(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, parameters: dict) -> np.ndarray:
        """RNEA for bodies with the given parameters (which need not be physical)."""
        model = self.model.copy()
        inertias = {joint: np.zeros(10) for joint in range(1, model.njoints)}
        for j in range(1, len(self.robot.links) + 1):
            joint, _ = self.frames[j]
            if joint:
                inertias[joint] += self.moved[j] @ np.array(
                    [parameters.get((j, kind), 0.0) for kind in ORDER]
                )
        for joint, phi in inertias.items():
            model.inertias[joint] = pin.Inertia.FromDynamicParameters(phi)
        return pin.rnea(model, model.createData(), q, dq, ddq)

    def mechanical_energy(self, q: np.ndarray, dq: np.ndarray, parameters: dict) -> float:
        """Kinetic plus potential energy of physical bodies."""
        model = self.model.copy()
        for j in range(1, len(self.robot.links) + 1):
            joint, place = self.frames[j]
            if joint:
                phi = np.array([parameters.get((j, kind), 0.0) for kind in ORDER])
                model.inertias[joint] += place.act(pin.Inertia.FromDynamicParameters(phi))
        return pin.computeMechanicalEnergy(model, model.createData(), q, dq)


def _moved(place: pin.SE3) -> np.ndarray:
    """10 x 10: parameters about a fixed frame -> the same body's about its joint's frame."""
    result = np.zeros((10, 10))
    T = place.homogeneous
    for k in range(10):
        M, MX, MY, MZ, XX, XY, YY, XZ, YZ, ZZ = np.eye(10)[k]
        inertia = np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])
        P = np.zeros((4, 4))
        P[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia
        P[:3, 3] = P[3, :3] = MX, MY, MZ
        P[3, 3] = M
        P = T @ P @ T.T
        J = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
        result[:, k] = [P[3, 3], *P[:3, 3], J[0, 0], J[0, 1], J[1, 1], J[0, 2], J[1, 2], J[2, 2]]
    return result


def numeric_base_count(
    robot: Robot, model: str, payload_row: int | None = None, seed: int = 0
) -> tuple[int, float]:
    """Rank of a model's stacked regressor at random states, and the gap between the singular values there.

    All standard columns, both sides of the drives with their offsets (paper eqs. 1 to 5): where a sensor and
    a motor are read, their rows stand apart. With `payload_row` half of the states are loaded runs, in which
    that link's ten columns act a second time. Columns are scaled to unit length first.
    """
    rng = np.random.default_rng(seed)
    independent, n = PinocchioRobot(robot), robot.n
    blocks = []
    for loaded in (False,) if payload_row is None else (False, True):
        for _ in range(10 * len(robot.links) // n + 30):
            q, dq, ddq = rng.uniform(-2, 2, (3, n))
            bodies = independent.regressor(q, dq, ddq)
            carried = [bodies[payload_row, kind] * loaded for kind in ORDER] if payload_row else []
            links = np.column_stack([*bodies.values(), *carried])
            friction = [np.diag(dq), np.diag(np.sign(dq)), np.eye(n)]
            motor, none, nothing = np.hstack([np.diag(ddq), *friction]), np.zeros((n, 4 * n)), links * 0
            joint, idle = np.hstack(friction), np.zeros((n, 3 * n))
            rows = {
                "tau_m": np.hstack([links, motor, joint]),
                "tau_l": np.hstack([links, none, joint]),
                "tau_d": np.hstack([nothing, motor, idle]),
            }
            blocks += [rows[family] for family in FAMILIES[model]]
    W = np.vstack(blocks)
    size = np.linalg.norm(W, axis=0)
    W = W[:, size > 1e-9 * size.max()]
    values = np.linalg.svd(W / np.linalg.norm(W, axis=0), compute_uv=False)
    values = np.append(values / values[0], 1e-18)
    rank = int(np.sum(values > 1e-10))
    return rank, float(values[rank - 1] / max(values[rank], 1e-18))
