"""A robot with its identified bodies as URDF: one link and one joint for each row of the MDH table.

The frame of row j is fixed to link j, with the joint along its z axis, so a link's <inertial> is that of its
standard parameters, and <origin> of its joint is the row's constant part (Rot_z(q) and Trans_z(r) commute).
`<dynamics damping friction>` hold viscous and dry friction of motor and link together. A gravity that does
not point along -z of the base turns the first link, since a URDF has no gravity of its own.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np

from ident.export.bodies import frames
from ident.export.consistent import Consistent
from modelgen.geometry.kinematics import geometry
from modelgen.geometry.robot import Limits, Robot

UNKNOWN = 1e6  # a limit that the robot file does not state


def write_urdf(robot: Robot, found: Consistent, note: str) -> str:
    """The text of the URDF. `note` is a comment: where the numbers are from."""
    turn = _upright(np.array([float(g) for g in geometry(robot).gravity]))
    top = Element("robot", name=robot.name)
    if not np.allclose(turn, np.eye(3), atol=1e-12):
        SubElement(top, "link", name="world")
        _joint(top, "world_to_base", "fixed", turn, np.zeros(3), ("world", "base"))
    SubElement(top, "link", name="base")
    names, places = ["base", *link_names(robot)], frames(robot)
    for j, link in enumerate(robot.links, 1):
        body, place = SubElement(top, "link", name=names[j]), places[j - 1]
        if found.combination.solid[j - 1]:
            body.append(inertial(found.bodies()[j - 1]))
        kind = "fixed" if link.sigma == 2 else ("prismatic" if link.sigma else "revolute")
        ends = (names[link.antecedent], names[j])
        joint = _joint(top, joint_name(robot, j), kind, place[:3, :3], place[:3, 3], ends)
        if link.sigma != 2:
            damping, friction = friction_of(found, robot.joint_labels[robot.moving.index(j)])
            SubElement(joint, "axis", xyz="0 0 1")
            SubElement(joint, "limit", _limits(link.limits, link.sigma))
            SubElement(joint, "dynamics", damping=repr(damping), friction=repr(friction))
    return as_text(top, note)


def as_text(top: Element, note: str) -> str:
    """XML with a first comment."""
    top.insert(0, Comment(f" {note.replace('--', '- -')} "))
    indent(top)
    return '<?xml version="1.0"?>\n' + tostring(top, encoding="unicode") + "\n"


def link_names(robot: Robot) -> list[str]:
    """Unique names of the rows' links."""
    given = [link.name or f"link{j}" for j, link in enumerate(robot.links, 1)]
    fine = len(set(given)) == len(given) and not {"base", "world"} & set(given)
    return given if fine else [f"link{j}" for j in range(1, len(given) + 1)]


def joint_name(robot: Robot, j: int) -> str:
    """The joint's own name (q3 where it has none) for a moving row, fixed4 for a fixed one."""
    if j not in robot.moving:
        return f"fixed{j}"
    names = robot.joint_names if len(set(robot.joint_names)) == robot.n else robot.variables
    return names[robot.moving.index(j)]


def friction_of(found: Consistent, label: str) -> tuple[float, float]:
    """Viscous and dry friction of a joint, motor and link side together; what noise made negative is zero."""
    names = found.combination.names

    def total(*kinds: str) -> float:
        own = [f"{kind}{label}{more}" for kind in kinds for more in ("", "R")]
        return float(sum(max(found.value(name), 0.0) for name in own if name in names))

    return total("Fvm", "Fvl"), total("Fcm", "Fcl")


def inertia_about_centre(phi: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre (3,), inertia about it (3, 3) of standard parameters (10,)."""
    XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = (float(v) for v in phi)
    c = np.array([MX, MY, MZ]) / M
    about_origin = np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])
    return M, c, about_origin - M * (c @ c * np.eye(3) - np.outer(c, c))


def inertial(phi: np.ndarray) -> Element:
    """<inertial> of standard parameters (10,)."""
    mass, c, inertia = inertia_about_centre(phi)
    element = Element("inertial")
    SubElement(element, "origin", xyz=numbers(c), rpy="0 0 0")
    SubElement(element, "mass", value=repr(mass))
    SubElement(element, "inertia", {f"i{a}{b}": repr(float(inertia["xyz".index(a), "xyz".index(b)]))
                                    for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")})  # fmt: skip
    return element


def _joint(
    top: Element, name: str, kind: str, R: np.ndarray, p: np.ndarray, ends: tuple[str, str]
) -> Element:
    joint = SubElement(top, "joint", name=name, type=kind)
    SubElement(joint, "origin", xyz=numbers(p), rpy=numbers(roll_pitch_yaw(R)))
    SubElement(joint, "parent", link=ends[0])
    SubElement(joint, "child", link=ends[1])
    return joint


def numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(v) + 0.0) for v in values)


def roll_pitch_yaw(R: np.ndarray) -> np.ndarray:
    """(3,) with R = Rot_z(yaw) Rot_y(pitch) Rot_x(roll), exact near a pitch of a quarter turn too."""
    cos_pitch = np.hypot(R[0, 0], R[1, 0])
    pitch = np.arctan2(-R[2, 0], cos_pitch)
    if cos_pitch < 1e-9:
        return np.array([0.0, pitch, np.arctan2(-R[0, 1], R[1, 1])])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def _upright(gravity: np.ndarray) -> np.ndarray:
    """Rotation that turns this gravity to -z."""
    size = np.linalg.norm(gravity)
    if size < 1e-12:
        return np.eye(3)
    g, down = gravity / size, np.array([0.0, 0.0, -1.0])
    v, c = np.cross(g, down), float(g @ down)
    if c < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + K + K @ K / (1 + c)


def _limits(limits: Limits | None, sigma: int) -> dict[str, str]:
    reach = 100.0 if sigma else 2 * np.pi * 100
    low, high = (limits.q if limits and limits.q else None) or (-reach, reach)
    effort = limits.tau if limits and limits.tau else UNKNOWN
    speed = limits.dq if limits and limits.dq else UNKNOWN
    values = {"lower": low, "upper": high, "effort": effort, "velocity": speed}
    return {key: repr(float(value)) for key, value in values.items()}
