"""The rise of friction at low speed that fades while the joint warms up."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter

T, vs = sp.symbols("T vs", real=True)


class ThermalStribeckFriction(Effect):
    """Fs exp(-t/T) exp(-(dq/vs)^2) sign(dq), t since the recording's first sample.

    T far beyond the recording makes it `stribeck_friction`, vs beyond its rates `thermal_coulomb_friction`.
    """

    name = "thermal_stribeck_friction"
    summary = "friction rises below a sliding speed while the joint is cold, and less as it warms"
    signature = "bumps of the sign of the rate around reversals that become smaller over the recording"
    source = (
        "Bittencourt and Gunnarsson, Static friction in a robot joint: modeling and identification of "
        "load and "
        "temperature effects, J. Dyn. Sys. Meas. Control 134(5), 2012"
    )
    contains = ("stribeck_friction",)
    remedy = "warm the robot up before recording, or add its term to the friction model"
    terms = {"Fs": sp.exp(-SIGNALS.t / T - (SIGNALS.dq / vs) ** 2) * SIGNALS.sign_dq}
    linear = (LinearParameter("Fs", "N m", 0.0, 100.0, "positive"),)
    nonlinear = (
        NonlinearParameter("vs", "rad/s", 0.005, 0.6, (0.02, 0.05, 0.12, 0.3)),
        NonlinearParameter("T", "s", 2.0, 2000.0, (10.0, 30.0, 90.0)),
    )
    typical = {"Fs": 5.0, "vs": 0.1, "T": 20.0}
    common = False


EFFECT = ThermalStribeckFriction()
