"""Which recorded torques a model's equations use: its channels, and the signals that they are made of."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.geometry.names import PREFIXES, Channel


@dataclass(frozen=True, slots=True)
class Need:
    """Signals that the channels of a study are made of.

    joints are numbered as in the robot file; channels in the order of the equations; motor and sensor are the
    joints (positions in `joints`) whose motor torque, or joint torque sensor, is read.
    """

    joints: tuple[int, ...]
    channels: tuple[Channel, ...]
    motor: tuple[int, ...]
    sensor: tuple[int, ...]
    model: str = "A"
    joint_names: tuple[str, ...] = ()  # as the robot file calls them; q1, ... where it does not

    @property
    def names(self) -> tuple[str, ...]:
        """("tau_m1", ...) of the channels."""
        return tuple(channel.name([str(joint) for joint in self.joints]) for channel in self.channels)

    def torque(self, motor: np.ndarray | None, sensor: np.ndarray | None) -> np.ndarray:
        """The channels, (N, channels), of signals as read (N, len(motor)), (N, len(sensor)): A motor, B
        sensor, C both, D motor - sensor (paper eq. 7)."""
        drives = [self.motor.index(c.joint) for c in self.channels if c.side in ("motor", "drive")]
        sensors = [self.sensor.index(c.joint) for c in self.channels if c.side in ("sensor", "drive")]
        before = motor[:, drives] if motor is not None else None
        behind = sensor[:, sensors] if sensor is not None else None
        if self.model == "D":
            assert before is not None and behind is not None
            return before - behind
        parts = [part for part in (before, behind) if part is not None and part.shape[1]]
        return parts[0] if len(parts) == 1 else np.hstack(parts)


def need_of(
    model: str,
    channels: Sequence[str],
    positions: str = "motor",
    chosen: Collection[str] | None = None,
    joint_names: Sequence[str] = (),
) -> Need:
    """What the channels of a compiled model need ("tau_m3"), or those that can be made of the `chosen` ones.

    Raises ValueError with a sentence for a chosen torque that is none of this robot's, or when none is left.
    """
    labels = tuple(dict.fromkeys(_label(name) for name in channels))
    found = tuple(Channel.of(name, labels) for name in channels)
    if chosen is not None:
        given = {Channel.of(name, labels) for name in chosen}
        found = tuple(channel for channel in found if channel in given or _parts(channel) <= given)
        if not found:
            raise ValueError(
                f"none of {', '.join(sorted(chosen))} is a torque of model {model}, whose channels are "
                f"{', '.join(channels)}; name some of these, or choose another model"
            )
    drives = tuple(sorted({c.joint for c in found if c.side in ("motor", "drive")}))
    sensors = {c.joint for c in found if c.side in ("sensor", "drive")}
    if positions == "joint":  # they are computed from all sensors
        sensors = set(range(len(labels)))
    joints = tuple(int(label) for label in labels)
    names = tuple(joint_names) or tuple(f"q{joint}" for joint in joints)
    return Need(joints, found, drives, tuple(sorted(sensors)), model, names)


def _parts(channel: Channel) -> set[Channel]:
    """The torques that a channel is the difference of (model D), else itself."""
    if channel.side != "drive":
        return {channel}
    return {Channel(channel.joint, "motor"), Channel(channel.joint, "sensor")}


def _label(name: str) -> str:
    return next(name.removeprefix(prefix) for prefix in PREFIXES.values() if name.startswith(prefix))
