"""Viscous friction that is not a straight line: a cubic part."""

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class NonlinearViscousFriction(Effect):
    """Viscous friction that is not a straight line: a cubic part."""

    name = "nonlinear_viscous_friction"
    summary = "friction bends away from a straight line at high rate, as the cube of the rate"
    signature = "against the rate: an S through the origin, largest at the fastest parts of the motion"
    source = "Bona and Indri, Friction compensation in robotics: an overview, CDC 2005"
    remedy = "add its term to the friction model; check grade and temperature of the lubricant"
    terms = {"Fv3": SIGNALS.dq**3}
    linear = (LinearParameter("Fv3", "N m s^3/rad^3", -50.0, 50.0),)
    typical = {"Fv3": 1.0}


EFFECT = NonlinearViscousFriction()
