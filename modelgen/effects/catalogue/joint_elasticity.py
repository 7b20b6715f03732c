"""A gear that yields: the encoder sits on the motor, the link stays behind by tau_link / k."""

from collections.abc import Mapping

import sympy as sp

from modelgen.effects.carried import HIDDEN_ROTOR, PASSED
from modelgen.effects.effect import Array, Columns, LinearParameter, Quantity
from modelgen.effects.kinds import MotionEffect
from modelgen.effects.memory import Memory
from modelgen.effects.motions import below_resonance, gear_columns
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.truth import Stage, Truth

k, compliance = sp.symbols("k compliance", real=True)


class JointElasticity(MotionEffect):
    """A gear that yields in proportion: q_link = q - tau_link / k.

    Where the base parameters do not part the rotor's inertia from the link's, tau_link is known but for
    Iam ddq: of a first joint whose rotor has a third of the inertia, a stiffness came out half too high.
    A delay of the torque spans nearly the same columns where the load is inertial; a stiffening gear holds
    this one as its first term.
    """

    name = "joint_elasticity"
    summary = "the gear yields, so the link is not where the motor's encoder says"
    signature = (
        "grows with the derivatives of the load: gravity torques shifted in position, inertial ones in "
        "their second derivative; the next joint shows an echo"
    )
    source = (
        "Spong, Modeling and control of elastic joint robots, J. Dyn. Sys. Meas. Control 109, 1987; "
        "appendix 2 of Jubien, Gautier, Janot 2014"
    )
    equation = "q_link = q - tau_link/k"
    remedy = "add the joint's stiffness to the model and the controller, or measure the link's position"
    terms = {"compliance": -PASSED}  # q_link - q
    linear = (LinearParameter("compliance", "rad/(N m)", 1e-7, 5e-2, "positive"),)
    nonlinear = (HIDDEN_ROTOR,)
    reported = (
        Quantity("k", "N m/rad", 1 / compliance),
        Quantity("Iam", HIDDEN_ROTOR.unit, HIDDEN_ROTOR.symbol),
    )
    inverse = {"compliance": 1 / k}
    typical = {"k": 3000.0, "Iam": 0.0}
    margin_s = 1.0

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """Torque per compliance of links displaced by -compliance tau, low-passed below the resonance."""
        assert place.joint is not None
        rotor = self.complete(theta)["Iam"]
        c = float(size[0]) if size is not None else 0.0
        cutoff = below_resonance(model, motion, place.joint, c, self.SHIFT_CUTOFF_HZ, rotor)
        change = gear_columns(model, motion, place.joint, lambda tau: -tau[:, None], size, cutoff, rotor)
        return {number: change[:, number] for number in range(len(model.channels))}

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return ("motor_motion",)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        """The motor is ahead of the link by tau_link / k."""
        assert place.joint is not None
        passed = truth.smooth(truth.smooth_link[:, place.joint])
        return truth.moved("motor", place.joint, passed * values["compliance"])


EFFECT = JointElasticity()
