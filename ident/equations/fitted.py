"""The model that is being fitted, at its current estimate, as effects may ask it (modelgen/effects/place.py).

An effect's column can depend on more than the motion: friction that grows with the load reads the torque that
the gear passes on, an elastic gear bends under it, a delay shifts the whole torque. All of that is computed
here from the compiled model and one chi; what has been asked for is remembered, since columns that ask for
nothing are the same for every estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ident.equations.columns import Columns
from ident.errors import StudyError
from ident.recordings.study import Study
from ident.signals.filtering import FilteredBlock
from modelgen.effects.place import Motion
from modelgen.geometry.names import Channel, ParameterName
from modelgen.geometry.robot import Robot

BEFORE_THE_GEAR = ("Iam", "Fvm", "Fcm", "Offm")


@dataclass(slots=True)
class Asked:
    """Whether any effect read the estimate."""

    estimate: bool = False


@dataclass(frozen=True)
class FittedModel:
    """Columns of a study with values chi (b,) of its rigid parameters.

    `vs`: {recording: (n,)} speeds from which signs are certain. `before`: torques of the effects that act
    before the one that asks, `(motion) -> (N, C)`.
    """

    study: Study
    columns: Columns
    robot: Robot
    chi: np.ndarray
    vs: Mapping[str, np.ndarray] = field(default_factory=dict)
    before: Callable[[Motion], np.ndarray] | None = None
    asked: Asked = field(default_factory=Asked)

    @property
    def channels(self) -> tuple[Channel, ...]:
        return self.columns.need.channels

    @property
    def parameters(self) -> tuple[str, ...]:
        return self.columns.parameters

    def torque(
        self,
        motion: Motion,
        q: np.ndarray | None = None,
        dq: np.ndarray | None = None,
        ddq: np.ndarray | None = None,
    ) -> np.ndarray:
        """(N, C) torque of the rigid model with its friction, at the motion or another one."""
        self.asked.estimate = True
        block = self._block(motion, q, dq, ddq)
        torque = self._compiled(self.chi, motion, block)[:, self.columns.rows].copy()
        gains = set(self.columns.gain_columns.values())
        for extra in self.columns.extras:
            if extra.column not in gains:
                torque[:, extra.channel] += self.chi[extra.column] * extra.values(block)
        return torque

    def total(self, motion: Motion) -> np.ndarray:
        """(N, C) torque with the effects that act before the one that asks."""
        torque = self.torque(motion)
        return torque if self.before is None else torque + self.before(motion)

    def link_torque(self, motion: Motion) -> np.ndarray:
        """(N, n) torque that each gear passes on: the sensor channel's where the model has one, else the
        motor's without rotor and friction. Raises StudyError for model D, which sees neither."""
        if self.study.model == "D":
            raise StudyError(
                str(self.study.file),
                "effects",
                "model D has no torque behind the gear, which one of the effects needs; choose A, B or C",
            )
        self.asked.estimate = True
        compiled = self._compiled(self._behind, motion, self._block(motion))
        n = len(self.columns.need.joints)
        return np.asarray(compiled[:, -n:] if self.study.model == "C" else compiled[:, :n])

    def regressor(self, motion: Motion) -> np.ndarray:
        """(N, C, b) columns of the parameters."""
        self.asked.estimate = True
        columns, block = self.columns, self._block(motion)
        used, channel, column = columns.entries(motion.payload)
        W = np.zeros((len(motion.t), len(columns.channels), len(columns.parameters)))
        free = column >= 0
        for rows, values in columns.model.nonzero_blocks(block.q, block.dq, block.ddq, sign=block.sign_dq):
            W[rows, channel[free], column[free]] = values[used[free]].T
        for extra in columns.extras:
            W[:, extra.channel, extra.column] += extra.values(block)
        return W

    def bodies(self) -> dict[str, float]:
        """{"MX2": value, ...} of the robot's own bodies."""
        self.asked.estimate = True
        return {
            its.standard: self.chi[k] for k, its in self._parsed.items() if its.of_body and not its.payload
        }

    def drive_inertia(self, joint: int) -> float:
        """Iam of the joint; 0 where it stands inside a regrouped inertia, which cannot be parted."""
        return self.number("Iam", joint) or 0.0

    def number(self, kind: str, joint: int) -> float | None:
        """Value of the drive parameter of this kind at a joint (from 0), None where there is none."""
        self.asked.estimate = True
        label = str(self.columns.need.joints[joint])
        for k, its in self._parsed.items():
            if its.kind == kind and its.label == label:
                return float(self.chi[k])
        return None

    @cached_property
    def _parsed(self) -> dict[int, ParameterName]:
        found = {k: ParameterName.of(name) for k, name in enumerate(self.columns.parameters)}
        return {k: its for k, its in found.items() if its}

    @cached_property
    def _behind(self) -> np.ndarray:
        """chi (b,) without what acts before the gears."""
        chi = self.chi.copy()
        chi[[k for k, its in self._parsed.items() if its.kind in BEFORE_THE_GEAR]] = 0.0
        return chi

    def _compiled(self, chi: np.ndarray, motion: Motion, block: FilteredBlock) -> np.ndarray:
        """(N, channels of the compiled model)."""
        values = self.columns.model_chi(chi, motion.payload)
        torque = self.columns.model.torque(block.q, block.dq, block.ddq, values, sign=block.sign_dq)
        return np.asarray(torque)

    def _block(
        self,
        motion: Motion,
        q: np.ndarray | None = None,
        dq: np.ndarray | None = None,
        ddq: np.ndarray | None = None,
    ) -> FilteredBlock:
        return FilteredBlock(
            motion.t,
            motion.q if q is None else q,
            motion.dq if dq is None else dq,
            motion.ddq if ddq is None else ddq,
            motion.sign_dq,
            None,
            None,
            self.vs.get(motion.recording, np.zeros(motion.q.shape[1])),
            np.ones_like(motion.q),
        )
