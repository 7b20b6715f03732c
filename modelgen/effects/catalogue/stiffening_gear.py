"""A gear whose stiffness grows with its load, as that of a harmonic drive does."""

from collections.abc import Mapping

import numpy as np

from modelgen.effects.carried import HIDDEN_ROTOR, PASSED
from modelgen.effects.effect import Array, Columns, LinearParameter
from modelgen.effects.kinds import MotionEffect
from modelgen.effects.memory import Memory
from modelgen.effects.motions import below_resonance, gear_columns
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.truth import Stage, Truth


class StiffeningGear(MotionEffect):
    """q_link = q - (compliance tau + cubic tau^3); cubic < 0 stiffens under load.

    From tau = k1 x + k3 x^3 it follows to third order that compliance = 1/k1 and cubic = -k3/k1^4. With
    cubic 0 it is `joint_elasticity`.
    """

    name = "stiffening_gear"
    summary = "the gear yields less and less as its load grows"
    signature = "as of an elastic joint, but saturating where the torque is largest"
    source = (
        "Tuttle and Seering, A nonlinear model of a harmonic drive gear transmission, IEEE Trans. Robot. "
        "Autom. "
        "12(3), 1996"
    )
    contains = ("joint_elasticity",)
    remedy = "add the gear's measured stiffness curve to the model, or measure the link's position"
    terms = {"compliance": -PASSED, "cubic": -(PASSED**3)}
    linear = (
        LinearParameter("compliance", "rad/(N m)", 1e-7, 5e-2, "positive", simpler=True),
        LinearParameter("cubic", "rad/(N m)^3", -1e-2, 1e-2),
    )
    nonlinear = (HIDDEN_ROTOR,)
    typical = {"compliance": 6e-4, "cubic": -1e-7, "Iam": 0.0}
    margin_s = 1.0
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
        """Torque per unit of each part of the deflection, low-passed below the resonance."""
        assert place.joint is not None
        rotor = self.complete(theta)["Iam"]
        c = float(size[0]) if size is not None else 0.0
        cutoff = below_resonance(model, motion, place.joint, c, self.SHIFT_CUTOFF_HZ, rotor)
        change = gear_columns(model, motion, place.joint, yielding, size, cutoff, rotor)
        return {number: change[:, number] for number in range(len(model.channels))}

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return ("motor_motion",)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        """The motor is ahead of the link by the deflection."""
        assert place.joint is not None
        passed = truth.smooth(truth.smooth_link[:, place.joint])
        ahead = -yielding(passed) @ np.array([values["compliance"], values["cubic"]])
        return truth.moved("motor", place.joint, ahead)


def yielding(tau: Array) -> Array:
    """(N, 2) q_link - q per unit of compliance and cubic."""
    return -np.stack([tau, tau**3], axis=1)


EFFECT = StiffeningGear()
