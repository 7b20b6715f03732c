"""Friction proportional to the joint's rate: the paper's own Fv dq."""

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class ViscousFriction(Effect):
    """Friction proportional to the joint's rate: the paper's own Fv dq."""

    name = "viscous_friction"
    summary = "friction proportional to the joint's rate"
    signature = "a straight line through the origin against the rate"
    source = "Reynolds 1886; eq. (4) of Jubien, Gautier and Janot 2014"
    remedy = "leave it in the model: remove it from the study's `without`"
    terms = {"Fv": SIGNALS.dq}
    linear = (LinearParameter("Fv", "N m s/rad", 0.0, 500.0, "positive"),)
    channel = "any"
    replaces = ("Fvm", "Fvl")
    typical = {"Fv": 8.0}


EFFECT = ViscousFriction()
