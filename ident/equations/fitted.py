"""The model that is being fitted, at its current estimate, as effects ask it (modelgen/geometry/place.py).

An effect's column can depend on more than the motion: friction that grows with the load reads the torque that
the gear passes on, an elastic gear bends under it, a delay shifts the whole torque. All of that is computed
here from the compiled model and one chi; that something was asked is remembered, since columns that ask for
nothing are the same for every estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ident.equations.columns import Columns
from ident.signals.filtering import FilteredBlock
from modelgen.geometry.names import Channel, ParameterName
from modelgen.geometry.place import Motion, torque_slopes

if TYPE_CHECKING:
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
    before the one that asks, `(motion) -> (N, C)`. `kept`: answers about motions that are asked about again.
    """

    columns: Columns
    robot: Robot
    chi: np.ndarray
    vs: Mapping[str, np.ndarray] = field(default_factory=dict)
    before: Callable[[Motion], np.ndarray] | None = None
    asked: Asked = field(default_factory=Asked)
    kept: dict[tuple[tuple[Hashable, ...], int], tuple[Motion, np.ndarray]] | None = None

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
        if q is None and dq is None and ddq is None:
            return self.once(("torque",), motion, lambda: self._torque(motion, self._block(motion)))
        return self._torque(motion, self._block(motion, q, dq, ddq))

    def _torque(self, motion: Motion, block: FilteredBlock) -> np.ndarray:
        torque = self._compiled(self.chi, motion, block)[:, self.columns.rows].copy()
        gains = set(self.columns.gain_columns.values())
        for extra in self.columns.extras:
            if extra.column not in gains:
                torque[:, extra.channel] += self.chi[extra.column] * extra.values(block)
        return torque

    def slopes(self, motion: Motion, joint: int) -> np.ndarray:
        """(3, N, C) derivatives of that torque by the joint's q, dq and ddq; kept of one joint at a time."""
        self.asked.estimate = True
        kind = ("slopes", joint)
        kept = self.kept or {}
        for key in [key for key in kept if key[0][0] == "slopes" and key[0] != kind]:
            del kept[key]
        return self.once(kind, motion, lambda: torque_slopes(self.torque, motion, joint))

    def total(self, motion: Motion) -> np.ndarray:
        """(N, C) torque with the effects that act before the one that asks."""
        before = self.before
        if before is None:
            return self.torque(motion)
        return self.once(("total", id(before)), motion, lambda: self.torque(motion) + before(motion))

    def link_torque(self, motion: Motion) -> np.ndarray:
        """(N, n) torque that each gear passes on: the sensor channel's where the model has one, else the
        motor's without rotor and friction. Model D sees neither: zeros."""
        self.asked.estimate = True
        n = len(self.columns.need.joints)

        def make() -> np.ndarray:
            compiled = self._compiled(self._behind, motion, self._block(motion))
            return np.asarray(compiled[:, -n:] if self.columns.need.model == "C" else compiled[:, :n])

        return self.once(("link",), motion, make)

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
        k = self.column(kind, joint)
        return None if k is None else float(self.chi[k])

    def column(self, kind: str, joint: int) -> int | None:
        """Where this drive parameter is in chi."""
        label = str(self.columns.need.joints[joint])
        for k, its in self._parsed.items():
            if its.kind == kind and its.label == label and not its.payload:
                return k
        return None

    def once(self, kind: tuple[Hashable, ...], motion: Motion, make: Callable[[], np.ndarray]) -> np.ndarray:
        if self.kept is None:
            return make()
        if (kind, id(motion)) not in self.kept:
            self.kept[kind, id(motion)] = motion, make()  # the motion is held: its id is nobody else's
        return self.kept[kind, id(motion)][1]

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
