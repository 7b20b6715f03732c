"""Friction that grows with a power of the rate below one, as grease does."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter

p = sp.Symbol("p", real=True)
REST = sp.Rational(1, 10**4)  # rad/s, keeps the slope at rest finite


class PowerLawFriction(Effect):
    """Friction that grows with a power of the rate below one, as grease does."""

    name = "power_law_friction"
    summary = "friction grows with a power of the rate below one (the square root for p = 0.5)"
    signature = "against the rate: steep near zero, flattening at speed; between a step and a straight line"
    source = "Bona and Indri, Friction compensation in robotics: an overview, CDC 2005"
    remedy = "add its term to the friction model; check the grease of the gear"
    terms = {"Fp": (SIGNALS.dq**2 + REST**2) ** (p / 2) * SIGNALS.sign_dq}
    linear = (LinearParameter("Fp", "N m (s/rad)^p", 0.0, 100.0, "positive"),)
    nonlinear = (NonlinearParameter("p", "-", 0.2, 0.8, (0.35, 0.5, 0.65)),)
    typical = {"Fp": 6.0, "p": 0.5}
    common = False


EFFECT = PowerLawFriction()
