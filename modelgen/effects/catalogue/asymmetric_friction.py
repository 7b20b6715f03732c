"""Viscous friction that differs between the two directions of motion."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class AsymmetricFriction(Effect):
    """Viscous friction that differs between the two directions of motion."""

    name = "asymmetric_friction"
    summary = "viscous friction differs between the two directions"
    signature = "a V against the rate; an offset does not show it because it vanishes at rest"
    source = "Armstrong, Friction: experimental determination, modeling and compensation, ICRA 1988"
    remedy = "add its term to the friction model; check alignment, preload and seals of the joint"
    terms = {"Fva": sp.Abs(SIGNALS.dq)}
    linear = (LinearParameter("Fva", "N m s/rad", -100.0, 100.0),)
    typical = {"Fva": 2.0}


EFFECT = AsymmetricFriction()
