"""URDFs for tests: real ones from packages, random trees, and Pinocchio's reading of the same file."""

from __future__ import annotations

import importlib.util
import os
import random
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin

from modelgen.geometry.kinematics import geometry, state, transforms
from modelgen.geometry.robot import Robot
from modelgen.geometry.urdf import Conversion

PACKAGES = ("airo_models", "robot_properties_fingers", "example_robot_data")
FOLDER = "DYNIDENT_URDFS"  # environment variable: a folder whose URDFs are tested too


def real_files() -> list[Path]:
    """URDFs of installed packages, and of the folder that DYNIDENT_URDFS names."""
    folders = [Path(os.environ[FOLDER])] if os.environ.get(FOLDER) else []
    for name in PACKAGES:
        spec = importlib.util.find_spec(name)
        if spec and spec.submodule_search_locations:
            folders.append(Path(next(iter(spec.submodule_search_locations))))
    site = Path(np.__file__).parents[1] / "cmeel.prefix" / "share" / "example-robot-data"
    return sorted(path for folder in [*folders, site] for path in folder.rglob("*.urdf"))


def plain(text: str) -> str:
    """Without prefixes of namespaces that the file does not declare."""
    return re.sub(r"\b\w+:(?=\w+[\s=/>])", "", re.sub(r'xmlns:\w+="[^"]*"', "", text))


def snapped(text: str) -> str:
    """The URDF with angles, axes and lengths replaced by what they are close to, in its own numbers."""

    def turn(x: float) -> float:
        for parts, tolerance in ((2, 2e-5), (12, 1e-9)):
            near = round(x * parts / np.pi) * np.pi / parts
            if abs(x - near) < tolerance:
                return near
        return x

    root = ET.fromstring(plain(text))
    for joint in root.findall("joint"):
        origin, axis = joint.find("origin"), joint.find("axis")
        if origin is not None:
            rpy = [turn(float(x)) for x in origin.get("rpy", "0 0 0").split()]
            xyz = [0.0 if abs(float(x)) < 1e-9 else float(x) for x in origin.get("xyz", "0 0 0").split()]
            origin.set("rpy", " ".join(map(repr, map(float, rpy))))
            origin.set("xyz", " ".join(map(repr, xyz)))
        if axis is not None:
            v = np.array([float(x) for x in axis.get("xyz", "1 0 0").split()])
            v = v / (np.linalg.norm(v) or 1.0)
            k = int(np.argmax(np.abs(v)))
            if np.linalg.norm(np.delete(v, k)) < 2e-5:
                v = np.sign(v[k]) * np.eye(3)[k]
            axis.set("xyz", " ".join(map(repr, v.tolist())))
    return ET.tostring(root).decode()


class PinocchioUrdf:
    """Pinocchio's model of a URDF text, addressed by our joint names in our order."""

    def __init__(self, text: str, names: tuple[str, ...]) -> None:
        self.model = pin.buildModelFromXML(plain(text))
        self.data = self.model.createData()
        self.joints = [self.model.joints[self.model.getJointId(name)] for name in names]

    def _q(self, q: np.ndarray) -> np.ndarray:
        out = pin.neutral(self.model)
        for joint, x in zip(self.joints, q):
            out[joint.idx_q : joint.idx_q + joint.nq] = (np.cos(x), np.sin(x)) if joint.nq == 2 else x
        return out

    def placements(self, q: np.ndarray) -> list[np.ndarray]:
        """4 x 4 of each joint's child link in the root."""
        pin.forwardKinematics(self.model, self.data, self._q(q))
        return [self.data.oMi[joint.id].homogeneous for joint in self.joints]

    def torque(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """RNEA of the URDF's own inertias, one state."""
        v, a = np.zeros(self.model.nv), np.zeros(self.model.nv)
        for joint, speed, acceleration in zip(self.joints, dq, ddq):
            v[joint.idx_v], a[joint.idx_v] = speed, acceleration
        tau = pin.rnea(self.model, self.data, self._q(q), v, a)
        return np.array([tau[joint.idx_v] for joint in self.joints])


def link_placements(conversion: Conversion, q: np.ndarray) -> list[np.ndarray]:
    """4 x 4 of each moving joint's child link in the root, by the MDH table."""
    poses = row_placements(conversion.robot, q)
    result = []
    for body in conversion.bodies:
        frame = np.eye(4)
        frame[:3, :3] = [[float(x) for x in row] for row in body.frame.R]
        frame[:3, 3] = [float(x) for x in body.frame.p]
        result.append(poses[body.row - 1] @ np.linalg.inv(frame))
    return result


def row_placements(robot: Robot, q: np.ndarray) -> list[np.ndarray]:
    """4 x 4 of every MDH frame in the base."""
    result: list[np.ndarray] = []
    for T in transforms(geometry(robot), state(robot, q, 0 * q, 0 * q)):
        pose = np.eye(4)
        pose[:3, :3] = np.array([T.to_antecedent(tuple(e)) for e in np.eye(3)], float).T
        pose[:3, 3] = [float(x) for x in T.p]
        result.append((result[T.row.antecedent] if T.row.antecedent >= 0 else np.eye(4)) @ pose)
    return result


ANGLES = (
    "0",
    "0",
    "1.5708",
    "-1.57079632679",
    "3.14159",
    "1.5707963267948966",
    "0.5235987756",
    "0.3",
    "-2.1",
)
AXES = ("0 0 1", "0 0 -1", "1 0 0", "0 -1 0", "0 1 0", "1 1 0", "0.6 0 0.8", "0.00001 0 1")


def random_urdf(rng: random.Random) -> str:
    """A tree of 2 to 9 joints of all kinds, right-angled or oblique, with bodies on every link."""
    count = rng.randint(2, 9)
    oblique = rng.random() < 0.3

    def triple(values: object) -> str:
        return " ".join(str(values()) for _ in range(3))  # type: ignore[operator]

    def angle() -> str:
        return f"{rng.uniform(-3, 3):.4f}" if oblique else rng.choice(ANGLES)

    def length() -> str:
        return rng.choice(("0", "0", f"{rng.uniform(-0.5, 0.5):.4f}", f"{rng.uniform(-0.5, 0.5)!r}", "1e-12"))

    links, joints = [], []
    for k in range(count + 1):
        a = np.array([[rng.gauss(0, 0.1) for _ in range(3)] for _ in range(3)])
        J = a @ a.T + 0.01 * np.eye(3)
        values = {
            "ixx": J[0, 0],
            "ixy": J[0, 1],
            "ixz": J[0, 2],
            "iyy": J[1, 1],
            "iyz": J[1, 2],
            "izz": J[2, 2],
        }
        inertia = " ".join(f'{key}="{float(value)!r}"' for key, value in values.items())
        body = (
            f'<inertial><origin xyz="{triple(length)}" rpy="{triple(angle)}"/>'
            f'<mass value="{rng.uniform(0.1, 5):.3f}"/><inertia {inertia}/></inertial>'
        )
        links.append(f'<link name="l{k}">{body if rng.random() < 0.8 else ""}</link>')
    for k in range(1, count + 1):
        parent = k - 1 if rng.random() < 0.7 else rng.randint(0, k - 1)
        kind = (
            rng.choice(("revolute", "revolute", "continuous", "prismatic", "fixed")) if k > 1 else "revolute"
        )
        axis = f"{rng.gauss(0, 1):.5f} {rng.gauss(0, 1):.5f} 0.5" if oblique else rng.choice(AXES)
        joints.append(
            f'<joint name="j{k}" type="{kind}"><parent link="l{parent}"/><child link="l{k}"/>'
            f'<origin xyz="{triple(length)}" rpy="{triple(angle)}"/><axis xyz="{axis}"/>'
            '<limit lower="-1" upper="2" effort="10" velocity="3"/></joint>'
        )
    rng.shuffle(links)
    return f'<?xml version="1.0"?><robot name="random">{"".join(links + joints)}</robot>'
