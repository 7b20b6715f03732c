"""A robot with its identified bodies as URDF: one link and one joint for each row of the MDH table.

The frame of row j is fixed to link j, with the joint along its z axis, so a link's <inertial> is that of its
standard parameters, and <origin> of its joint is the row's constant part (Rot_z(q) and Trans_z(r) commute).
`<dynamics damping friction>` hold viscous and dry friction of motor and link together. A gravity that does
not point along -z of the base turns the first link, since a URDF has no gravity of its own.
"""

from __future__ import annotations

from xml.sax.saxutils import escape

import numpy as np

from ident.export.bodies import frames
from ident.export.consistent import Consistent
from modelgen.geometry.kinematics import geometry
from modelgen.geometry.robot import Limits, Robot

UNKNOWN = 1e6  # a limit that the robot file does not state


def write_urdf(robot: Robot, found: Consistent, note: str) -> str:
    """The text of the URDF. `note` is a comment: where the numbers are from."""
    table = geometry(robot)
    turn = _upright(np.array([float(g) for g in table.gravity]))
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- {escape(note).replace('--', '- -')} -->",
        f'<robot name="{escape(robot.name)}">',
    ]
    upright = np.allclose(turn, np.eye(3), atol=1e-12)
    if not upright:
        lines += [
            '  <link name="world"/>',
            '  <joint name="world_to_base" type="fixed">',
            f"    {_origin(turn, np.zeros(3))}",
            '    <parent link="world"/>',
            '    <child link="base"/>',
            "  </joint>",
        ]
    lines.append('  <link name="base"/>')
    names, places = ["base", *link_names(robot)], frames(robot)
    for j, link in enumerate(robot.links, 1):
        place = places[j - 1]
        solid = found.combination.solid[j - 1]
        lines += _link(names[j], found.bodies()[j - 1]) if solid else [f'  <link name="{names[j]}"/>']
        kind = "fixed" if link.sigma == 2 else ("prismatic" if link.sigma else "revolute")
        lines.append(f'  <joint name="{joint_name(robot, j)}" type="{kind}">')
        lines.append(f"    {_origin(place[:3, :3], place[:3, 3])}")
        lines.append(f'    <parent link="{names[link.antecedent]}"/>')
        lines.append(f'    <child link="{names[j]}"/>')
        if link.sigma != 2:
            label = robot.joint_labels[robot.moving.index(j)]
            damping, friction = friction_of(found, label)
            lines.append('    <axis xyz="0 0 1"/>')
            lines.append(f"    {_limits(link.limits, link.sigma)}")
            lines.append(f'    <dynamics damping="{damping!r}" friction="{friction!r}"/>')
        lines.append("  </joint>")
    return "\n".join([*lines, "</robot>", ""])


def link_names(robot: Robot) -> list[str]:
    """Unique names of the rows' links."""
    given = [link.name or f"link{j}" for j, link in enumerate(robot.links, 1)]
    fine = len(set(given)) == len(given) and not {"base", "world"} & set(given)
    return [escape(name) for name in given] if fine else [f"link{j}" for j in range(1, len(given) + 1)]


def joint_name(robot: Robot, j: int) -> str:
    """The joint's own name (q3 where it has none) for a moving row, fixed4 for a fixed one."""
    if j not in robot.moving:
        return f"fixed{j}"
    names = robot.joint_names if len(set(robot.joint_names)) == robot.n else robot.variables
    return escape(names[robot.moving.index(j)])


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


def _link(name: str, phi: np.ndarray) -> list[str]:
    mass, c, inertia = inertia_about_centre(phi)
    terms = " ".join(
        f'{key}="{float(inertia[a, b])!r}"'
        for key, a, b in (
            ("ixx", 0, 0),
            ("ixy", 0, 1),
            ("ixz", 0, 2),
            ("iyy", 1, 1),
            ("iyz", 1, 2),
            ("izz", 2, 2),
        )
    )
    return [
        f'  <link name="{name}">',
        "    <inertial>",
        f"      {_origin(np.eye(3), c)}",
        f'      <mass value="{mass!r}"/>',
        f"      <inertia {terms}/>",
        "    </inertial>",
        "  </link>",
    ]


def _origin(R: np.ndarray, p: np.ndarray) -> str:
    return f'<origin xyz="{_three(p)}" rpy="{_three(roll_pitch_yaw(R))}"/>'


def _three(values: np.ndarray) -> str:
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


def _limits(limits: Limits | None, sigma: int) -> str:
    reach = 100.0 if sigma else 2 * np.pi * 100
    low, high = (limits.q if limits and limits.q else None) or (-reach, reach)
    effort = limits.tau if limits and limits.tau else UNKNOWN
    speed = limits.dq if limits and limits.dq else UNKNOWN
    values = {"lower": low, "upper": high, "effort": effort, "velocity": speed}
    return "<limit " + " ".join(f'{key}="{float(value)!r}"' for key, value in values.items()) + "/>"
