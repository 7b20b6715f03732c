"""Bags of one motion, written with `rosbags`: the same joint states as ROS 1, ROS 2 (sqlite3) and MCAP."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

KINDS = ("position", "velocity", "effort")
START = 1_700_000_000 * 10**9
POINTS = ("reference", "feedback", "error", "output")
CONTROLLER = """std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint feedback
trajectory_msgs/JointTrajectoryPoint error
trajectory_msgs/JointTrajectoryPoint output
string[] multi_dof_joint_names
"""
DYNAMIC = """std_msgs/Header header
string[] joint_names
control_msgs/InterfaceValue[] interface_values
"""
INTERFACE = "string[] interface_names\nfloat64[] values\n"


class BagWriter:
    """`with BagWriter(path, "mcap") as bag: bag.joints("/joint_states", stamp_ns, names, position=...)`;
    kinds are ros1, sqlite3, mcap."""

    def __init__(self, path: Path, kind: str) -> None:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.ros1 = kind == "ros1"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        for name, text in (
            ("InterfaceValue", INTERFACE),
            ("DynamicJointState", DYNAMIC),
            ("JointTrajectoryControllerState", CONTROLLER),
        ):
            if f"control_msgs/msg/{name}" not in self.store.types:
                self.store.register(get_types_from_msg(text, f"control_msgs/msg/{name}"))
        plugins = {"sqlite3": rosbag2.StoragePlugin.SQLITE3, "mcap": rosbag2.StoragePlugin.MCAP}
        self.writer: Any = (
            rosbag1.Writer(path)
            if self.ros1
            else rosbag2.Writer(path, version=9, storage_plugin=plugins[kind])
        )
        self.connections: dict[str, Any] = {}

    def __enter__(self) -> BagWriter:
        self.writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def write(self, topic: str, received: int, message: Any) -> None:
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        serialize = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        self.writer.write(self.connections[topic], received, serialize(message, kind))

    def header(self, stamp: int) -> Any:
        types = self.store.types
        time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
        more = {"seq": 0} if self.ros1 else {}
        return types["std_msgs/msg/Header"](stamp=time, frame_id="", **more)

    def joints(
        self,
        topic: str,
        stamp: int,
        names: Sequence[str],
        *,
        received: int | None = None,
        **values: Any,
    ) -> None:
        """One JointState; position, velocity, effort as given."""
        arrays = {kind: np.asarray(values.get(kind, ()), float) for kind in KINDS}
        state = self.store.types["sensor_msgs/msg/JointState"]
        message = state(header=self.header(stamp), name=list(names), **arrays)
        self.write(topic, stamp if received is None else received, message)

    def point(self, **values: Any) -> Any:
        types = self.store.types
        zero = types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
        arrays = {
            name: np.asarray(values.get(name, ()), float)
            for name in ("positions", "velocities", "accelerations", "effort")
        }
        return types["trajectory_msgs/msg/JointTrajectoryPoint"](time_from_start=zero, **arrays)

    def controller(self, topic: str, stamp: int, names: Sequence[str], **points: Mapping[str, Any]) -> None:
        fields = {name: self.point(**points.get(name, {})) for name in POINTS}
        state = self.store.types["control_msgs/msg/JointTrajectoryControllerState"]
        message = state(
            header=self.header(stamp), joint_names=list(names), multi_dof_joint_names=[], **fields
        )
        self.write(topic, stamp, message)

    def dynamic(self, topic: str, stamp: int, values: Mapping[str, Mapping[str, float]]) -> None:
        types = self.store.types
        each = [
            types["control_msgs/msg/InterfaceValue"](
                interface_names=list(one), values=np.array(list(one.values()), float)
            )
            for one in values.values()
        ]
        state = types["control_msgs/msg/DynamicJointState"]
        message = state(header=self.header(stamp), joint_names=list(values), interface_values=each)
        self.write(topic, stamp, message)

    def blob(self, topic: str, stamp: int, size: int) -> None:
        """What fills bags: images."""
        types = self.store.types
        data = np.random.default_rng(stamp).integers(0, 255, size, dtype=np.uint8)
        image = types["sensor_msgs/msg/Image"](
            header=self.header(stamp),
            height=1,
            width=size,
            encoding="mono8",
            is_bigendian=0,
            step=size,
            data=data,
        )
        self.write(topic, stamp, image)


def write_bag(
    path: Path,
    kind: str,
    columns: Mapping[str, np.ndarray],
    names: Sequence[str],
    topic: str = "/joint_states",
) -> Path:
    """t, q1.., dq1.., tau_m1.. as JointState messages, the joints of each message in another order."""
    stamps = np.rint(columns["t"] * 1e9).astype(np.int64) + START
    rng = np.random.default_rng(0)
    orders = [rng.permutation(len(names)) for _ in range(4)]
    arrays = {
        kind: np.column_stack([columns[f"{signal}{k + 1}"] for k in range(len(names))])
        for kind, signal in (("position", "q"), ("velocity", "dq"), ("effort", "tau_m"))
        if f"{signal}1" in columns
    }
    with BagWriter(path, kind) as bag:
        for row, stamp in enumerate(stamps.tolist()):
            order = orders[row % 4]
            shuffled = {name: values[row, order] for name, values in arrays.items()}
            received = stamp + 2_000_000 + int(rng.integers(0, 400_000))
            bag.joints(topic, stamp, [names[k] for k in order], received=received, **shuffled)
    return path
