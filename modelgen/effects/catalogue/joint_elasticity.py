"""A gear that yields: the encoder sits on the motor, the link stays behind by tau_link / k."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, Quantity

k, compliance = sp.symbols("k compliance", real=True)

EFFECT = Effect(
    name="joint_elasticity",
    summary="the gear yields, so the link is not where the motor's encoder says",
    signature="grows with the derivatives of the load: gravity torques shifted in position, inertial ones in "
    "their second derivative; the next joint shows an echo",
    source="Spong, Modeling and control of elastic joint robots, J. Dyn. Sys. Meas. Control 109, 1987; "
    "appendix 2 of Jubien, Gautier, Janot 2014",
    terms={"compliance": -SIGNALS.tau_link},  # q_link - q
    linear=(LinearParameter("compliance", "rad/(N m)", 1e-7, 5e-2, "positive"),),
    reported=(Quantity("k", "N m/rad", 1 / compliance),),
    inverse={"compliance": 1 / k},
    kind="motion",
    channel="link",
    typical={"k": 3000.0},
)
