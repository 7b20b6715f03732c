"""Dry friction that grows with the torque the gear carries."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class LoadDependentFriction(Effect):
    """Dry friction that grows with the torque the gear carries."""

    name = "load_dependent_friction"
    summary = "dry friction grows with the torque that the gear passes on"
    signature = "steps at reversals whose height follows |tau_link|: small where the arm hangs"
    source = (
        "Hamon, Gautier, Garrec, Dynamic identification of robots with a dry friction model depending on "
        "load and velocity, IROS 2010"
    )
    remedy = "add its term to the friction model; check the lubrication of the gear"
    terms = {"mu": sp.Abs(SIGNALS.tau_link) * SIGNALS.sign_dq}
    linear = (LinearParameter("mu", "-", 0.0, 0.4, "positive"),)
    typical = {"mu": 0.08}


EFFECT = LoadDependentFriction()
