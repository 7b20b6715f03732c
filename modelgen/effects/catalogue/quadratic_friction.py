"""Friction that grows with the square of the rate: churning lubricant, air drag."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class QuadraticFriction(Effect):
    """Fv2 dq |dq|. Beside viscous friction it bends the same way as a cubic part
    (`nonlinear_viscous_friction`), less sharply: only a wide range of rates tells them apart."""

    name = "quadratic_friction"
    summary = "friction grows with the square of the rate"
    signature = "against the rate: a bend away from the line that opens with speed, odd in the rate"
    source = "turbulent drag: Newton 1687; gears in oil: Changenet and Velex, J. Mech. Des. 129, 2007"
    remedy = "add its term to the friction model; check level and grade of the lubricant"
    terms = {"Fv2": SIGNALS.dq * sp.Abs(SIGNALS.dq)}
    linear = (LinearParameter("Fv2", "N m s^2/rad^2", -100.0, 100.0),)
    typical = {"Fv2": 1.0}
    common = False


EFFECT = QuadraticFriction()
