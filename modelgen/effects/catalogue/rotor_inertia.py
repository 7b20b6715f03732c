"""Inertia of the rotor and the gear, seen through the square of the gear ratio: the paper's Iam."""

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class RotorInertia(Effect):
    """Inertia of the rotor and the gear, seen through the square of the gear ratio: the paper's Iam."""

    name = "rotor_inertia"
    summary = "inertia of rotor and gear, on the joint side"
    signature = "proportional to the joint's own acceleration, the same in every pose"
    source = "eq. (1) of Jubien, Gautier and Janot 2014; Khalil and Dombre 2002, sec. 9.4"
    remedy = "leave it in the model: remove it from the study's `without`"
    terms = {"Ia": SIGNALS.ddq}
    linear = (LinearParameter("Ia", "kg m^2", 0.0, 100.0, "positive"),)
    replaces = ("Iam",)
    typical = {"Ia": 1.5}


EFFECT = RotorInertia()
