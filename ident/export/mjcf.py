"""A robot with its identified bodies as MJCF: armature, damping and frictionloss beside the inertias, motors.

MuJoCo's joint adds armature ddq + damping dq, and a dry friction that never exceeds frictionloss; its
`<inertial>` takes the full inertia about the centre of mass. A torque that is recorded before the position
that it causes is a command: its motor acts that much later. One that is recorded after it comes from a
slower sensor: the joint gets such a sensor. Both need the `delay` of MuJoCo 3.5. Offsets and other found
effects have no element.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

import numpy as np

from ident.export.bodies import frames
from ident.export.combination import ExportError
from ident.export.consistent import Consistent
from ident.export.urdf import friction_of, inertia_about_centre, joint_name, link_names
from modelgen.geometry.kinematics import geometry
from modelgen.geometry.robot import Robot

TIMESTEP = 1e-3  # s, of a robot with delays; buffers last down to half of it


def write_mjcf(robot: Robot, found: Consistent, note: str, delays: Mapping[int, float] | None = None) -> str:
    """The text of the MJCF; checked by MuJoCo where it is installed. `delays`: {joint from 0: s}."""
    table = geometry(robot)
    step = f' timestep="{TIMESTEP}"' if delays else ""
    gravity = " ".join(repr(float(g)) for g in table.gravity)
    lines = [
        f"<!-- {note.replace('--', '- -').replace('<', '(').replace('>', ')')} -->",
        f"<mujoco model={quoteattr(robot.name)}>",
        '  <compiler angle="radian" autolimits="true"/>',
        f'  <option gravity="{gravity}"{step}/>',
        "  <worldbody>",
        *_bodies(robot, found, 0, "    "),
        "  </worldbody>",
        *_motors(robot, delays or {}),
        "</mujoco>",
        "",
    ]
    text = "\n".join(lines)
    check(text)
    return text


def _bodies(robot: Robot, found: Consistent, antecedent: int, indent: str) -> list[str]:
    lines, places = [], frames(robot)
    for j, link in enumerate(robot.links, 1):
        if link.antecedent != antecedent:
            continue
        place = places[j - 1]
        lines.append(
            f'{indent}<body name="{link_names(robot)[j - 1]}" pos="{_numbers(place[:3, 3])}" '
            f'quat="{_numbers(_quaternion(place[:3, :3]))}">'
        )
        if found.combination.solid[j - 1]:
            lines.append(f"{indent}  {_inertial(found.bodies()[j - 1])}")
        if link.sigma != 2:
            label = robot.joint_labels[robot.moving.index(j)]
            damping, friction = friction_of(found, label)
            kind = "slide" if link.sigma else "hinge"
            reach = f' range="{_numbers(link.limits.q)}"' if link.limits and link.limits.q else ""
            lines.append(
                f'{indent}  <joint name={quoteattr(joint_name(robot, j))} type="{kind}" axis="0 0 1"{reach} '
                f'armature="{max(found.value(f"Iam{label}"), 0.0)!r}" damping="{damping!r}" '
                f'frictionloss="{friction!r}"/>'
            )
        lines += [*_bodies(robot, found, j, indent + "  "), f"{indent}</body>"]
    return lines


def _motors(robot: Robot, delays: Mapping[int, float]) -> list[str]:
    """A motor a joint, torque-limited where its limit is known, and sensors of torques that come late."""
    motors, sensors = [], []
    for k, j in enumerate(robot.moving):
        name, limits, delay = quoteattr(joint_name(robot, j)), robot.link(j).limits, delays.get(k, 0.0)
        most = f' ctrlrange="{_numbers([-limits.tau, limits.tau])}"' if limits and limits.tau else ""
        samples = math.ceil(2 * abs(delay) / TIMESTEP) + 2
        late = f' delay="{abs(delay)!r}" nsample="{samples}" interp="linear"' if delay else ""
        motors.append(f"    <motor name={name} joint={name}{most}{late if delay < 0 else ''}/>")
        if delay > 0:
            sensors.append(f"    <jointactuatorfrc name={name} joint={name}{late}/>")
    measured = ["  <sensor>", *sensors, "  </sensor>"] if sensors else []
    return ["  <actuator>", *motors, "  </actuator>", *measured]


def _inertial(phi: np.ndarray) -> str:
    mass, c, J = inertia_about_centre(phi)
    full = _numbers([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])
    return f'<inertial pos="{_numbers(c)}" mass="{mass!r}" fullinertia="{full}"/>'


def _numbers(values: object) -> str:
    return " ".join(repr(float(v) + 0.0) for v in values)  # type: ignore[attr-defined]


def _quaternion(R: np.ndarray) -> np.ndarray:
    """(w, x, y, z) of a rotation, from the eigenvector of Bar-Itzhack's matrix (exact at every angle)."""
    K = np.array(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2]],
            [0, R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1], R[0, 2] - R[2, 0]],
            [0, 0, R[2, 2] - R[0, 0] - R[1, 1], R[1, 0] - R[0, 1]],
            [0, 0, 0, R[0, 0] + R[1, 1] + R[2, 2]],
        ]
    )
    _, vectors = np.linalg.eigh(K, UPLO="U")
    x, y, z, w = vectors[:, -1]
    return np.array([w, x, y, z])


def check(text: str) -> None:
    """Let MuJoCo read it, where MuJoCo is. Raises ExportError for a MuJoCo that is too old for delays; any
    other complaint is ours to mend, so it is raised as it is."""
    try:
        import mujoco
    except ImportError:
        return
    if "nsample=" in text and not hasattr(mujoco.MjModel, "actuator_delay"):
        raise ExportError(
            f"MuJoCo {mujoco.__version__} knows no delays, which this robot has; pip install -U "
            "'dynident[mujoco]'"
        )
    mujoco.MjModel.from_xml_string(text)


def is_checked() -> bool:
    """Whether MuJoCo is there to read what is written."""
    return importlib.util.find_spec("mujoco") is not None
