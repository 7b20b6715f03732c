"""Presliding friction: before it slips, dry friction is a spring with a memory."""

from collections.abc import Mapping

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter, Quantity, State
from modelgen.effects.states import integrate_dahl

width, sigma, Fc = sp.symbols("width sigma Fc", real=True)
direction = sp.sign(SIGNALS.step)

# Dahl: dF/dq = sigma (1 - F/Fc sign dq). With F = Fc z and width = Fc/sigma: dz/dq = (1 - z sign dq)/width,
# solved exactly over a step of q, so the loop does not depend on the rate.
DAHL = State(
    update=direction + (SIGNALS.z - direction) * sp.exp(-sp.Abs(SIGNALS.step) / width),
    integrate=integrate_dahl,
    low=-1.0,
    high=1.0,
)


class Hysteresis(Effect):
    """Presliding friction: before it slips, dry friction is a spring with a memory."""

    name = "hysteresis"
    summary = "dry friction builds up over a small travel after each reversal instead of jumping"
    signature = "a decaying lag after every reversal, a function of the travel since then and not of the rate"
    source = "Dahl, A solid friction model, Aerospace Corp. TOR-0158(3107-18)-1, 1968"
    equation = "tau += Fc (z - sign(dq)), dz/dq = (1 - z sign(dq)) sigma/Fc"
    remedy = "compensate with this term at reversals, or avoid small reversing motions in what is fitted"
    terms = {"Fc": SIGNALS.z - SIGNALS.sign_dq}  # instead of the sign that the model has
    linear = (LinearParameter("Fc", "N m", 0.0, 200.0, "positive"),)
    nonlinear = (
        NonlinearParameter("width", "rad", 3e-4, 0.8, (1e-3, 3e-3, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)),
    )
    reported = (Quantity("sigma", "N m/rad", Fc / width), Quantity("Fc", "N m", Fc))
    inverse = {"width": Fc / sigma}
    state = DAHL
    sizes = ("sigma",)
    proportional = False
    typical = {"sigma": 150.0, "Fc": 6.0}
    share = 0.1

    def usual(self, given: Mapping[str, float], own: Mapping[str, float]) -> dict[str, float]:
        """It replaces the joint's own dry friction."""
        values = super().usual(given, own)
        if own.get("Fc"):
            values = {"sigma": self.typical["sigma"] * own["Fc"] / self.typical["Fc"], "Fc": own["Fc"]}
        return {**values, **given}


EFFECT = Hysteresis()
