"""Viscous friction that falls while the joint warms up."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter, Quantity

T, a, Fv, aFv = sp.symbols("T a Fv aFv", real=True)


class ThermalFriction(Effect):
    """Viscous friction that falls while the joint warms up."""

    name = "thermal_friction"
    summary = "viscous friction is higher by a fraction a at the start and falls with time constant T"
    signature = "proportional to the rate, fading over the recording; every recording starts cold"
    source = "Bittencourt and Gunnarsson, J. Dyn. Sys. Meas. Control 134(5), 2012; Simoni et al., IFAC 2017"
    remedy = "warm the robot up before recording, or add its term to the friction model"
    terms = {"aFv": sp.exp(-SIGNALS.t / T) * SIGNALS.dq}
    linear = (LinearParameter("aFv", "N m s/rad", 0.0, 100.0, "positive"),)
    nonlinear = (NonlinearParameter("T", "s", 2.0, 2000.0, (5.0, 10.0, 20.0, 40.0, 80.0, 160.0)),)
    reported = (Quantity("a", "-", aFv / Fv), Quantity("T", "s", T))
    inverse = {"aFv": a * Fv}
    context = ("Fv",)
    typical = {"a": 0.5, "T": 20.0}


EFFECT = ThermalFriction()
