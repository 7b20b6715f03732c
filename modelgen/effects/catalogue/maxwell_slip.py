"""Presliding friction as three springs that slip one after the other: the generalised Maxwell-slip model."""

from collections.abc import Mapping

import numpy as np
import sympy as sp

from modelgen.effects.effect import SIGNALS, Array, Effect, LinearParameter, NonlinearParameter, Quantity
from modelgen.effects.memory import Memory, at_first, carried
from modelgen.effects.place import Model
from modelgen.effects.states import integrate_play

Wa, Wb, Wc, width = sp.symbols("Wa Wb Wc width", real=True)
SPREAD = {"za": 1, "zb": 3, "zc": 9}  # widths of the elements, in units of the first


class MaxwellSlip(Effect):
    """Three elements in parallel, each a spring of stiffness W/width that slips at its force W:

        F = Wa za + Wb zb + Wc zc,   z = clip(z + dq/width, -1, 1)   with widths w, 3 w, 9 w

    instead of as much of the joint's sign(dq). It depends on the path and not on the rate. `hysteresis`
    (Dahl) is one smooth element: the two span nearly the same columns where the reversals are few.
    """

    name = "maxwell_slip"
    summary = "dry friction builds up after a reversal as elements of growing travel begin to slip"
    signature = "loops in the torque against the position around every reversal, with inner loops"
    source = (
        "Al-Bender, Lampaert, Swevers, The generalized Maxwell-slip model: a novel model for friction "
        "simulation and compensation, IEEE Trans. Autom. Control 50(11), 2005"
    )
    equation = "tau += Wa za + Wb zb + Wc zc - (Wa + Wb + Wc) sign(dq), each z = clip(z + dq/width, -1, 1)"
    contains = ("hysteresis",)
    remedy = "compensate with this term at reversals, or avoid small reversing motions in what is fitted"
    terms = {
        "Wa": SIGNALS.za - SIGNALS.sign_dq,
        "Wb": SIGNALS.zb - SIGNALS.sign_dq,
        "Wc": SIGNALS.zc - SIGNALS.sign_dq,
    }
    linear = tuple(LinearParameter(name, "N m", 0.0, 200.0, "positive") for name in ("Wa", "Wb", "Wc"))
    nonlinear = (NonlinearParameter("width", "rad", 1e-5, 0.1, (1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03)),)
    reported = (
        *(Quantity(name, "N m", sp.Symbol(name, real=True)) for name in ("Wa", "Wb", "Wc")),
        Quantity("width", "rad", width),
        Quantity("sigma", "N m/rad", (Wa + Wb / 3 + Wc / 9) / width),  # of all springs together
    )
    updates = {
        name: (sp.Abs(moved + 1) - sp.Abs(moved - 1)) / 2  # clip(moved, -1, 1)
        for name, ratio in SPREAD.items()
        for moved in [sp.Symbol(name, real=True) + SIGNALS.step / (ratio * width)]
    }
    sizes = ("Wa", "Wb", "Wc")
    typical = {"Wa": 2.0, "Wb": 2.0, "Wc": 2.0, "width": 0.01}
    share = 0.1
    common = False

    def physical(self, values: Mapping[str, float], model: Model | None = None) -> str | None:
        if sum(values.get(name, 1.0) > 0 for name in self.sizes) < 2:
            return "one element alone is a `hysteresis`"
        return super().physical(values, model)

    def states(
        self,
        signals: Mapping[str, Array],
        theta: Mapping[str, float],
        recording: str = "",
        memory: Memory | None = None,
        key: object = None,
    ) -> dict[str, Array]:
        """{"za", "zb", "zc"} along q, relaxed at the first sample or going on from `memory`."""
        if "q" not in signals:
            return {}
        q, out = signals["q"], {}
        t = signals.get("t", np.arange(len(q)))
        for name, ratio in SPREAD.items():
            travel = {"travel": 2 * ratio * theta["width"]}

            def slip(path: Array, first: float, travel: Mapping[str, float] = travel) -> Array:
                return integrate_play(path, travel, first)

            begun = at_first(signals, slip, 0.0)
            out[name] = carried(memory, (self.name, key, name), recording, t, q, slip, begun)
        return out


EFFECT = MaxwellSlip()
