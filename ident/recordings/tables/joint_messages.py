"""What ROS messages say about joints: which types do, and one message as names and arrays.

Columns are called `position.JOINT`, `velocity.JOINT`, `effort.JOINT` whatever the type; a controller's
reference and output stand apart as `reference.position.JOINT`, `output.effort.JOINT`; a DynamicJointState's
interfaces keep their own names. What effort means is the driver's secret (`DRIVERS`), never guessed here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

Joints = tuple[list[str], dict[str, np.ndarray]]  # names, and one value per name for each quantity

QUANTITIES = {
    "positions": "position",
    "velocities": "velocity",
    "accelerations": "acceleration",
    "effort": "effort",
}
POINTS = {
    "feedback": "",
    "actual": "",
    "reference": "reference.",
    "desired": "reference.",
    "output": "output.",
}

# What is known of drivers; shown in the help and by `ident inspect`, as a hint and not as an answer.
DRIVERS = (
    ("Universal Robots (ur_robot_driver)", "motor_current", "motor current in A"),
    ("Franka (franka_ros, franka_ros2)", "joint_torque", "link side torque in N m"),
    ("KUKA LBR (iiwa_stack, lbr_fri_ros2_stack)", "joint_torque", "measured link side torque in N m"),
    ("Kinova Gen3 (ros_kortex, ros2_kortex)", "joint_torque", "torque sensor in N m"),
    ("Gazebo, MuJoCo, Isaac Sim", "motor_torque", "torque of the actuator in N m"),
)


def joint_state(message: Any) -> Joints:
    """sensor_msgs/JointState; arrays that are not filled in are left out."""
    arrays = {"position": message.position, "velocity": message.velocity, "effort": message.effort}
    return list(message.name), {kind: values for kind, values in arrays.items() if len(values)}


def controller_state(message: Any) -> Joints:
    """control_msgs/JointTrajectoryControllerState, under the field names of all its versions."""
    found: dict[str, np.ndarray] = {}
    for field, prefix in POINTS.items():
        point = getattr(message, field, None)
        for array, kind in QUANTITIES.items():
            values: Any = getattr(point, array, ())
            if len(values):
                found.setdefault(prefix + kind, values)
    return list(message.joint_names), found


def dynamic_joint_state(message: Any) -> Joints:
    """control_msgs/DynamicJointState: every joint names its own interfaces."""
    names = list(message.joint_names)
    found: dict[str, np.ndarray] = {}
    for k, values in enumerate(message.interface_values[: len(names)]):
        for kind, value in zip(values.interface_names, values.values):
            found.setdefault(kind, np.full(len(names), np.nan))[k] = value
    return names, found


READERS: Mapping[str, Callable[[Any], Joints]] = {  # the first of equals is preferred
    "sensor_msgs/msg/JointState": joint_state,
    "control_msgs/msg/JointTrajectoryControllerState": controller_state,
    "control_msgs/msg/DynamicJointState": dynamic_joint_state,
}

# For bags that do not carry definitions (ROS 2 before Iron); the controller state has had several, so that
# without its definition it cannot be read.
DEFINITIONS = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": "std_msgs/Header header\nstring[] joint_names\n"
    "control_msgs/InterfaceValue[] interface_values\n",
}
