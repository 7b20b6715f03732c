"""The rigid model at its current estimate, as effects ask it: torques on a stretch, torques behind the
gear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ident.diagnosis.fine import FineSegment
from ident.equations.columns import Columns
from modelgen.effects.place import Motion
from modelgen.geometry.names import Channel, ParameterName
from modelgen.geometry.robot import Robot


def motion_of(segment: FineSegment) -> Motion:
    return Motion(
        segment.label,
        segment.payload,
        segment.t - segment.begun,
        segment.q,
        segment.dq,
        segment.ddq,
        segment.sign_dq,
        segment.measured,
        segment.rate_hz,
    )


class FittedModel:
    """The protocol `modelgen.effects.place.Model` over a study's columns and their estimate chi (b,).

    `added(motion) -> (N, C)` is the torque of what was found. Everything asked once for a motion is kept.
    """

    def __init__(self, robot: Robot, columns: Columns, chi: np.ndarray, added: Any = None) -> None:
        self.robot, self.columns, self.chi, self.added = robot, columns, chi, added
        self.channels = tuple(Channel.of(name, robot.joint_labels) for name in columns.channels)
        self.parameters = tuple(columns.parameters)
        self.names = tuple(ParameterName.of(name) for name in self.parameters)
        self._kept: dict[tuple[str, int], np.ndarray] = {}
        self._link = np.array(
            [0.0 if name is not None and name.side == "motor" else 1.0 for name in self.names]
        )

    def _of(self, kind: str, motion: Motion, make: Any) -> np.ndarray:
        key = (kind, id(motion))
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]

    def _torque(self, chi: np.ndarray, motion: Motion, q: Any, dq: Any, ddq: Any) -> np.ndarray:
        signals = [np.ascontiguousarray(x) for x in (q, dq, ddq)]
        inner = self.columns.model_chi(chi, motion.payload)
        sign = np.ascontiguousarray(motion.sign_dq)
        return np.asarray(self.columns.model.torque(*signals, inner, sign=sign))

    def torque(self, motion: Motion, q: Any = None, dq: Any = None, ddq: Any = None) -> np.ndarray:
        """(N, C) rigid torque; what was found is not in it."""
        if q is None and dq is None and ddq is None:
            return self._of(
                "torque", motion, lambda: self._torque(self.chi, motion, motion.q, motion.dq, motion.ddq)
            )
        return self._torque(
            self.chi,
            motion,
            motion.q if q is None else q,
            motion.dq if dq is None else dq,
            motion.ddq if ddq is None else ddq,
        )

    def total(self, motion: Motion) -> np.ndarray:
        """(N, C) with what was found."""
        if self.added is None:
            return self.torque(motion)
        return self._of("total", motion, lambda: self.torque(motion) + self.added(motion))

    def link_torque(self, motion: Motion) -> np.ndarray:
        """(N, n): the model without what stands before the gear; the sensor's row where there is one."""

        def make() -> np.ndarray:
            whole = self._torque(self.chi * self._link, motion, motion.q, motion.dq, motion.ddq)
            out = np.zeros((len(motion.t), self.robot.n))
            for side in ("motor", "sensor"):
                for c, channel in enumerate(self.channels):
                    if channel.side == side:
                        out[:, channel.joint] = whole[:, c]
            return out

        return self._of("link", motion, make)

    def regressor(self, motion: Motion) -> np.ndarray:
        """(N, C, b) of the study's parameters."""
        inner = np.asarray(self.columns.model.regressor(motion.q, motion.dq, motion.ddq, sign=motion.sign_dq))
        used, channel, column = self.columns.entries(motion.payload)
        place = np.asarray(self.columns.model.nonzeros)[used, 1]
        out = np.zeros((*inner.shape[:2], len(self.parameters)))
        free = column >= 0
        out[:, channel[free], column[free]] = inner[:, channel[free], place[free]]
        return out

    def bodies(self) -> Mapping[str, float]:
        return {
            name.standard: float(value)
            for name, value in zip(self.names, self.chi)
            if name is not None and name.of_body and not name.payload
        }

    def drive_inertia(self, joint: int) -> float:
        return self.number("Iam", joint) or 0.0

    def number(self, kind: str, joint: int) -> float | None:
        place = place_of(self.names, kind, self.robot.joint_labels[joint])
        return None if place is None else float(self.chi[place])


def place_of(names: Sequence[ParameterName | None], kind: str, label: str) -> int | None:
    """Position of a joint's parameter of one kind."""
    for k, name in enumerate(names):
        if name is not None and name.kind == kind and name.label == label and not name.payload:
            return k
    return None
