"""A gear that yields and keeps part of it: its angle lags behind the load, as in harmonic drives and
cables."""

from collections.abc import Mapping

import numpy as np

from modelgen.effects.carried import HIDDEN_ROTOR, PASSED
from modelgen.effects.effect import SIGNALS, Array, Columns, LinearParameter, NonlinearParameter
from modelgen.effects.kinds import MotionEffect
from modelgen.effects.memory import Memory, carried
from modelgen.effects.motions import below_resonance, gear_columns, passed_on
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.states import integrate_dahl
from modelgen.effects.truth import Stage, Truth


class HystereticGear(MotionEffect):
    """q_link = q - (compliance tau + lost z), dz/dtau = (1 - z sign dtau)/width: Dahl's law over the torque.

    2 lost is the width of the loop of angle against torque, `width` the change of torque that closes it. With
    lost 0 it is `joint_elasticity`; with a width far below the torque's swing, `backlash` in the torque's
    sign.
    """

    name = "hysteretic_gear"
    summary = "the gear's angle lags behind its load in a loop"
    signature = "position torques shifted by an angle that depends on where the load came from"
    source = (
        "Dhaouadi, Ghorbel, Gandhi, A new dynamic model of hysteresis in harmonic drives, "
        "IEEE Trans. Ind. Electron. 50(6), 2003; Seyfferth, Maghzal, Angeles, ICRA 1995"
    )
    equation = "q_link = q - compliance tau_link - lost z, dz/dtau = (1 - z sign(dtau))/width"
    contains = ("joint_elasticity",)
    remedy = "measure the link's position, or approach positions under a load from one side"
    terms = {"compliance": -PASSED, "lost": -SIGNALS.z}
    linear = (
        LinearParameter("compliance", "rad/(N m)", 0.0, 5e-2, "positive", simpler=True),
        LinearParameter("lost", "rad", 0.0, 0.05, "positive"),
    )
    nonlinear = (NonlinearParameter("width", "N m", 0.1, 1e3, (1.0, 3.0, 10.0, 30.0, 100.0)), HIDDEN_ROTOR)
    sizes = ("compliance", "lost")
    typical = {"compliance": 1e-4, "lost": 1e-3, "width": 10.0, "Iam": 0.0}
    margin_s = 1.0
    common = False

    def numpy_columns(self, signals: Mapping[str, Array], theta: Mapping[str, float] | None = None) -> Array:
        """The state goes with the torque, not with the position."""
        if "z" not in signals and "tau_link" in signals:
            theta = self.complete(theta)
            passed = signals["tau_link"] - theta["Iam"] * signals.get("ddq", 0.0)
            z = integrate_dahl(np.asarray(passed, dtype=float), theta)
            signals = {**signals, "z": z}
        return super().numpy_columns(signals, theta)

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
        j, theta = place.joint, self.complete(theta)
        assert j is not None

        def loop(tau: Array, first: float) -> Array:
            return integrate_dahl(tau, theta, first)

        rotor = theta["Iam"]
        passed = passed_on(model, motion, j, rotor)
        z = carried(memory, (self.name, place), motion.recording, motion.t, passed, loop, 0.0)
        first = float(z[0]) if len(z) else 0.0
        c = float(size[0]) if size is not None else 0.0
        cutoff = below_resonance(model, motion, j, c, self.SHIFT_CUTOFF_HZ, rotor)
        change = gear_columns(
            model, motion, j, lambda tau: -np.stack([tau, loop(tau, first)], axis=1), size, cutoff, rotor
        )
        return {number: change[:, number] for number in range(len(model.channels))}

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return ("motor_motion",)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        """The motor is ahead of the link by the deflection."""
        assert place.joint is not None
        passed = truth.smooth(truth.smooth_link[:, place.joint])
        z = truth.smooth(integrate_dahl(passed, {"width": values["width"]}))
        return truth.moved("motor", place.joint, values["compliance"] * passed + values["lost"] * z)


EFFECT = HystereticGear()
