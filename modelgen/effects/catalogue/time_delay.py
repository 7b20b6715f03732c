"""Torque recorded later than position: two devices, two clocks, a filter in the drive."""

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter

EFFECT = Effect(
    name="time_delay",
    summary="the torque is recorded a fixed time after the position",
    signature="the residual follows the torque's own derivative, most at reversals where friction jumps",
    source="Gautier, Dynamic identification of robots with power model, ICRA 1997 (phase shifts)",
    terms={"delay": -SIGNALS.dtau},  # first order; the simulator shifts exactly
    linear=(LinearParameter("delay", "s", 0.0, 0.1, "positive"),),
    kind="measurement",
    channel="any",
    shared=True,
    typical={"delay": 0.006},
)
