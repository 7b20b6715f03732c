"""Free play of a gear in which nothing is carried: a notch in the torque while the motor crosses the gap."""

import sympy as sp

from modelgen.effects.backlash import PLAY
from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter, Quantity

gap, travel, loss = sp.symbols("gap travel loss", real=True)

EFFECT = Effect(
    name="backlash_release",
    summary="the link's torque is not passed on while the motor crosses the free play after a reversal",
    signature="a notch of the size of the link's torque after each reversal, over a travel of the gap",
    source="Nordin and Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38, 2002 "
    "(dead-zone model of the shaft torque)",
    terms={"loss": -SIGNALS.tau_link * (1 - SIGNALS.z**8)},  # 0 on the flanks z = +-1, about 1 between them
    linear=(LinearParameter("loss", "-", 0.0, 1.2, "positive"),),
    nonlinear=(NonlinearParameter("travel", "rad", 1e-5, 0.05, (1e-3, 3e-3, 0.01, 0.03)),),
    reported=(Quantity("gap", "rad", travel), Quantity("loss", "-", loss)),
    inverse={"travel": gap},
    channel="link",
    state=PLAY,
    sizes=("gap",),
    typical={"gap": 3e-3, "loss": 1.0},
    told_as="backlash",
    common=False,
)
