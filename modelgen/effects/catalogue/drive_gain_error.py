"""A drive gain or sensor scale that is not what the data sheet says."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, Quantity

gain, excess = sp.symbols("gain excess", real=True)

EFFECT = Effect(
    name="drive_gain_error",
    summary="the measured torque of one joint is a constant factor times the true one",
    signature="the residual is a scaled copy of the torque itself; inertial parameters shared with other "
    "joints move some of it there",
    source="Gautier and Briot, Global identification of joint drive gains and dynamic parameters of robots, "
    "J. Dyn. Sys. Meas. Control 136(5), 2014",
    terms={"excess": SIGNALS.tau},
    linear=(LinearParameter("excess", "-", -0.5, 0.5),),
    reported=(Quantity("gain", "-", 1 + excess),),
    inverse={"excess": gain - 1},
    kind="measurement",
    channel="any",
    typical={"gain": 1.08},
)
