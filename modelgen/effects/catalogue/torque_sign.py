"""A torque that is recorded with the other sign than the joint's position counts."""

from collections.abc import Mapping

import numpy as np

from modelgen.effects.effect import Array, Columns
from modelgen.effects.kinds import RecordingEffect
from modelgen.effects.memory import Memory
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.truth import Truth


class TorqueSign(RecordingEffect):
    """The recorded torque is minus the true one: the model's own rows change sign, exactly and with no
    number.

    A drive gain of -1 is the same; only `drive_gain_error` near 1 is another effect.
    """

    name = "torque_sign"
    summary = "a torque is recorded with the other sign"
    signature = "friction and rotor inertia of the joint come out negative, and its neighbours disagree"
    told_by = ("torque_sign",)  # checks of a recording that are this effect
    source = "Khalil and Dombre, Modeling, identification and control of robots, 2002 (signs of joints)"
    equation = "recorded = -tau"
    remedy = "give the channel its sign: `columns: {NAME: {sign: -1}}`"
    changes_model = True
    common = False

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """No column of its own: see `regressor_change`."""
        return {c: np.zeros((len(motion.t), 0)) for c in place.rows(model.channels)}

    def regressor_change(
        self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model
    ) -> dict[int, Array]:
        """-2 W in the rows of the channel."""
        own = np.zeros(len(model.channels))
        own[list(place.rows(model.channels))] = -2.0
        W = model.regressor(motion)
        return {number: W[:, :, number] * own for number in range(W.shape[2])}

    def torque_change(
        self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model, chi: Array
    ) -> Array:
        """-2 times the model's torque, without its columns."""
        turned = np.zeros((len(motion.t), len(model.channels)))
        c = list(place.rows(model.channels))
        turned[:, c] = -2.0 * model.torque(motion)[:, c]
        return turned

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        return -tau


EFFECT = TorqueSign()
