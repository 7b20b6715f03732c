"""Dry friction that opposes the motion whatever its speed: the paper's own Fc sign(dq)."""

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class CoulombFriction(Effect):
    """Dry friction that opposes the motion whatever its speed: the paper's own Fc sign(dq)."""

    name = "coulomb_friction"
    summary = "dry friction of constant size that changes sign with the rate"
    signature = "a step of 2 Fc wherever the joint's rate changes sign, flat elsewhere"
    source = "Coulomb 1785; eq. (4) of Jubien, Gautier and Janot 2014"
    remedy = "leave it in the model: remove it from the study's `without`"
    terms = {"Fc": SIGNALS.sign_dq}
    linear = (LinearParameter("Fc", "N m", 0.0, 200.0, "positive"),)
    channel = "any"
    replaces = ("Fcm", "Fcl")
    typical = {"Fc": 5.0}


EFFECT = CoulombFriction()
