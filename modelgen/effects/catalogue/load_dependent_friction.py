"""Dry friction that grows with the torque the gear carries."""

import sympy as sp

from modelgen.effects.carried import CARRIED, HIDDEN_ROTOR, OWN_FRICTION, OWN_OFFSET
from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class LoadDependentFriction(Effect):
    """Dry friction mu |tau_link| sign(dq). Where the base parameters do not part the rotor's inertia from the
    link's, the torque that the gear carries is known but for Iam ddq, and Iam is found with mu, as are the
    shares of the joint's other friction (`own`) and of its constant torque (`own_offset`) that the gear
    carries."""

    name = "load_dependent_friction"
    summary = "dry friction grows with the torque that the gear passes on"
    signature = "steps at reversals whose height follows |tau_link|: small where the arm hangs"
    source = (
        "Hamon, Gautier, Garrec, Dynamic identification of robots with a dry friction model depending on "
        "load and velocity, IROS 2010"
    )
    remedy = "add its term to the friction model; check the lubrication of the gear"
    terms = {"mu": sp.Abs(CARRIED) * SIGNALS.sign_dq}
    linear = (LinearParameter("mu", "-", 0.0, 0.4, "positive"),)
    nonlinear = (HIDDEN_ROTOR, OWN_FRICTION, OWN_OFFSET)
    typical = {"mu": 0.08, "Iam": 0.0, "own": 0.0, "own_offset": 0.0}


EFFECT = LoadDependentFriction()
