"""A constant torque that nothing moves: the zero of a current amplifier or of a torque sensor."""

import sympy as sp

from modelgen.effects.effect import Effect, LinearParameter


class Offset(Effect):
    """A constant torque that nothing moves: the zero of a current amplifier or of a torque sensor."""

    name = "offset"
    summary = "a constant added to the measured torque"
    signature = "a residual whose mean is not zero, in every pose and at every rate"
    source = "eq. (4) of Jubien, Gautier and Janot 2014 (Offm, Offl)"
    remedy = "leave it in the model: remove it from the study's `without`, or zero the sensor"
    terms = {"off": sp.Integer(1)}
    linear = (LinearParameter("off", "N m", -50.0, 50.0),)
    channel = "any"
    replaces = ("Offm", "Offl")
    typical = {"off": 1.5}


EFFECT = Offset()
