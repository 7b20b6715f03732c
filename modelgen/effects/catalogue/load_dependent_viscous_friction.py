"""Viscous friction that grows with the torque the gear carries."""

import sympy as sp

from modelgen.effects.carried import CARRIED, HIDDEN_ROTOR, OWN_FRICTION, OWN_OFFSET
from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class LoadDependentViscousFriction(Effect):
    """Viscous friction that grows with the torque the gear carries."""

    name = "load_dependent_viscous_friction"
    summary = "the slope of friction against the rate grows with the torque that the gear passes on"
    signature = "proportional to the rate with a slope that follows |tau_link|"
    source = "Hamon, Gautier, Garrec, IROS 2010 (friction depending on load and velocity)"
    remedy = "add its term to the friction model; check the lubrication of the gear"
    terms = {"muv": sp.Abs(CARRIED) * SIGNALS.dq}
    linear = (LinearParameter("muv", "s/rad", 0.0, 0.5, "positive"),)
    nonlinear = (HIDDEN_ROTOR, OWN_FRICTION, OWN_OFFSET)
    typical = {"muv": 0.08, "Iam": 0.0, "own": 0.0, "own_offset": 0.0}
    common = False


EFFECT = LoadDependentViscousFriction()
