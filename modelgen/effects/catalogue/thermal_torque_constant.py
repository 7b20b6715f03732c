"""A motor whose torque per ampere falls as its magnets warm, while the record keeps the cold constant."""

from collections.abc import Mapping

import numpy as np
import sympy as sp

from modelgen.effects.effect import SIGNALS, Array, Columns, LinearParameter, NonlinearParameter
from modelgen.effects.kinds import RecordingEffect
from modelgen.effects.memory import Memory
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.truth import Truth

T = sp.Symbol("T", real=True)


class ThermalTorqueConstant(RecordingEffect):
    """Recorded torque, current times the cold constant, is (1 + a (1 - exp(-t/T))) times the true one.

    Remanence falls by about 0.1 % a kelvin (NdFeB) and 0.2 % (ferrite). Every recording starts cold. Viscous
    friction that falls meanwhile (`thermal_friction`) goes with the rate, this with the torque.
    """

    name = "thermal_torque_constant"
    summary = "the torque per ampere falls while the motor warms, so the recorded torque reads too high"
    signature = "a scaled copy of the torque itself that grows over the recording and levels off"
    source = (
        "Sebastian, Temperature effects on torque production and efficiency of PM motors using NdFeB "
        "magnets, "
        "IEEE Trans. Ind. Appl. 31(2), 1995"
    )
    remedy = "record warm, or correct the torque constant with the winding's temperature"
    terms = {"a": SIGNALS.tau * (1 - sp.exp(-SIGNALS.t / T))}
    linear = (LinearParameter("a", "-", 0.0, 0.3, "positive"),)
    nonlinear = (NonlinearParameter("T", "s", 5.0, 5000.0, (20.0, 60.0, 200.0, 600.0)),)
    typical = {"a": 0.05, "T": 60.0}
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
        """The torque that acts, growing over the recording."""
        warm = -np.expm1(-motion.t / self.complete(theta)["T"])
        total = model.total(motion)
        return {c: (total[:, c] * warm)[:, None] for c in place.rows(model.channels)}

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        return tau * (1.0 - values["a"] * np.expm1(-(truth.t - truth.t[0]) / values["T"]))


EFFECT = ThermalTorqueConstant()
