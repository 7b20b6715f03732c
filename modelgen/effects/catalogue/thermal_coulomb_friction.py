"""Dry friction that falls while the joint warms up."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter, Quantity

T, a, Fc, aFc = sp.symbols("T a Fc aFc", real=True)


class ThermalCoulombFriction(Effect):
    """a Fc exp(-t/T) sign(dq), t since the recording's first sample: every recording starts cold."""

    name = "thermal_coulomb_friction"
    summary = "dry friction is higher by a fraction a at the start and falls with time constant T"
    signature = "steps at every reversal that become smaller over the recording"
    source = (
        "Bittencourt and Gunnarsson, Static friction in a robot joint: modeling and identification of "
        "load and "
        "temperature effects, J. Dyn. Sys. Meas. Control 134(5), 2012"
    )
    remedy = "warm the robot up before recording, or add its term to the friction model"
    terms = {"aFc": sp.exp(-SIGNALS.t / T) * SIGNALS.sign_dq}
    linear = (LinearParameter("aFc", "N m", 0.0, 200.0, "positive"),)
    nonlinear = (NonlinearParameter("T", "s", 2.0, 2000.0, (5.0, 10.0, 20.0, 40.0, 80.0, 160.0)),)
    reported = (Quantity("a", "-", aFc / Fc), Quantity("T", "s", T))
    inverse = {"aFc": a * Fc}
    context = ("Fc",)
    sizes = ("a",)
    typical = {"a": 0.5, "T": 20.0}
    common = False


EFFECT = ThermalCoulombFriction()
