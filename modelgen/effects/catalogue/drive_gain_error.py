"""A drive gain or sensor scale that is not what the data sheet says."""

from collections.abc import Mapping

import sympy as sp

from modelgen.effects.effect import SIGNALS, Array, Columns, LinearParameter, Quantity
from modelgen.effects.kinds import RecordingEffect
from modelgen.effects.memory import Memory
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.truth import Truth

gain, excess = sp.symbols("gain excess", real=True)


class DriveGainError(RecordingEffect):
    """Measured torque is gain times the true one.

    A gain near -1 is a flipped sign, `torque_sign`.
    """

    name = "drive_gain_error"
    summary = "the measured torque of one joint is a constant factor times the true one"
    signature = (
        "the residual is a scaled copy of the torque itself; inertial parameters shared with other "
        "joints move some of it there"
    )
    told_by = ("torque_scale",)  # checks of a recording that are this effect
    source = (
        "Gautier and Briot, Global identification of joint drive gains and dynamic parameters of robots, "
        "J. Dyn. Sys. Meas. Control 136(5), 2014"
    )
    equation = "recorded = gain tau"
    remedy = "divide the channel by the gain: `columns` with a scale, or the drive's gain in the study"
    terms = {"excess": SIGNALS.tau}
    linear = (LinearParameter("excess", "-", -0.5, 0.5),)
    reported = (Quantity("gain", "-", 1 + excess),)
    inverse = {"excess": gain - 1}
    typical = {"gain": 1.08}
    tried = (-0.9, -0.75, -0.5, -0.25, 0.5, 1.0, 4.0, 9.0)

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """The torque that acts."""
        total = model.total(motion)
        return {c: total[:, [c]] for c in place.rows(model.channels)}

    def factor(self, size: Array) -> float:
        return 1.0 + float(size[0])

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        return tau * (1.0 + values["excess"])


EFFECT = DriveGainError()
