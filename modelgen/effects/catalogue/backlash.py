"""Free play of a gear: after a reversal the motor crosses the gap before the link follows."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter, Quantity, State
from modelgen.effects.states import integrate_play

gap, travel, drop = sp.symbols("gap travel drop", real=True)
moved = SIGNALS.z + 2 * SIGNALS.step / travel

# The play operator: z is the motor's place inside the gap, -1 and +1 are the two flanks.
PLAY = State(update=(sp.Abs(moved + 1) - sp.Abs(moved - 1)) / 2, integrate=integrate_play, low=-1.0, high=1.0)

# 1 between the flanks, 0 on them: 1 - clip(5 |z| - 4, 0, 1)
near = 5 * sp.Abs(SIGNALS.z) - 4
crossing = 1 - (sp.Abs(near) - sp.Abs(near - 1) + 1) / 2

EFFECT = Effect(
    name="backlash",
    summary="the link rests while the motor crosses the free play of the gear after each reversal",
    signature="short pulses after reversals; position torques shift by half the gap with the direction",
    source="Nordin and Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38, 2002",
    terms={
        "gap": -SIGNALS.z / 2,  # q_link - q
        "drop": -SIGNALS.tau_link * crossing,  # share of the link's torque not passed on meanwhile
    },
    torque_terms=("drop",),
    linear=(
        LinearParameter("gap", "rad", 0.0, 0.02, "positive"),
        LinearParameter("drop", "-", 0.0, 1.2, "positive", optional=True),
    ),
    nonlinear=(NonlinearParameter("travel", "rad", 1e-5, 0.02, (3e-4, 1e-3, 3e-3, 0.01)),),
    reported=(Quantity("gap", "rad", gap), Quantity("drop", "-", drop)),
    inverse={"travel": gap},
    kind="motion",
    channel="link",
    state=PLAY,
    sizes=("gap",),
    typical={"gap": 2e-3, "drop": 0.0},
)
