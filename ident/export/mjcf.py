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
from xml.etree.ElementTree import Element, SubElement

from scipy.spatial.transform import Rotation

from ident.export.bodies import frames
from ident.export.combination import ExportError
from ident.export.consistent import Consistent
from ident.export.urdf import as_text, friction_of, inertia_about_centre, joint_name, link_names, numbers
from modelgen.geometry.kinematics import geometry
from modelgen.geometry.robot import Robot

TIMESTEP = 1e-3  # s, of a robot with delays; buffers last down to half of it


def write_mjcf(robot: Robot, found: Consistent, note: str, delays: Mapping[int, float] | None = None) -> str:
    """The text of the MJCF; checked by MuJoCo where it is installed. `delays`: {joint from 0: s}."""
    top = Element("mujoco", model=robot.name)
    SubElement(top, "compiler", angle="radian", autolimits="true")
    step = {"timestep": str(TIMESTEP)} if delays else {}
    SubElement(top, "option", {"gravity": numbers(float(g) for g in geometry(robot).gravity)} | step)
    bodies = [SubElement(top, "worldbody")]  # by row, the world first
    names, places = link_names(robot), frames(robot)
    for j, link in enumerate(robot.links, 1):
        place = places[j - 1]
        x, y, z, w = Rotation.from_matrix(place[:3, :3]).as_quat()
        at = {"pos": numbers(place[:3, 3]), "quat": numbers((w, x, y, z))}
        bodies.append(SubElement(bodies[link.antecedent], "body", {"name": names[j - 1]} | at))
        if found.combination.solid[j - 1]:
            mass, c, J = inertia_about_centre(found.bodies()[j - 1])
            full = numbers([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])
            SubElement(bodies[j], "inertial", pos=numbers(c), mass=repr(mass), fullinertia=full)
        if link.sigma != 2:
            label = robot.joint_labels[robot.moving.index(j)]
            damping, friction = friction_of(found, label)
            reach = {"range": numbers(link.limits.q)} if link.limits and link.limits.q else {}
            kind = {"type": "slide" if link.sigma else "hinge", "axis": "0 0 1"} | reach
            armature = repr(max(found.value(f"Iam{label}"), 0.0))
            rubs = {"armature": armature, "damping": repr(damping), "frictionloss": repr(friction)}
            SubElement(bodies[j], "joint", {"name": joint_name(robot, j)} | kind | rubs)
    _motors(top, robot, delays or {})
    text = as_text(top, note)
    check(text)
    return text


def _motors(top: Element, robot: Robot, delays: Mapping[int, float]) -> None:
    """A motor a joint, torque-limited where its limit is known, and sensors of torques that come late."""
    motors, sensors = SubElement(top, "actuator"), Element("sensor")
    for k, j in enumerate(robot.moving):
        name, limits, delay = joint_name(robot, j), robot.link(j).limits, delays.get(k, 0.0)
        samples = math.ceil(2 * abs(delay) / TIMESTEP) + 2
        late = {"delay": repr(abs(delay)), "nsample": str(samples), "interp": "linear"} if delay else {}
        most = {"ctrlrange": numbers([-limits.tau, limits.tau])} if limits and limits.tau else {}
        SubElement(motors, "motor", {"name": name, "joint": name} | most | (late if delay < 0 else {}))
        if delay > 0:
            SubElement(sensors, "jointactuatorfrc", {"name": name, "joint": name} | late)
    if len(sensors):
        top.append(sensors)


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
