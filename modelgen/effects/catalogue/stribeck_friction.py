"""Friction that rises when the lubricant film thins out at low speed."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter

vs = sp.Symbol("vs", real=True)


class StribeckFriction(Effect):
    """Friction that rises when the lubricant film thins out at low speed."""

    name = "stribeck_friction"
    summary = "friction rises below a sliding speed of about vs"
    signature = "bumps of the sign of the rate around every reversal, gone above two or three vs"
    source = "Stribeck 1902; Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994"
    remedy = "add its term to the friction model; check the lubrication, or avoid creeping motions"
    terms = {"Fs": sp.exp(-((SIGNALS.dq / vs) ** 2)) * SIGNALS.sign_dq}
    linear = (LinearParameter("Fs", "N m", 0.0, 100.0, "positive"),)
    nonlinear = (NonlinearParameter("vs", "rad/s", 0.005, 0.6, (0.01, 0.02, 0.04, 0.07, 0.12, 0.2, 0.35)),)
    typical = {"Fs": 4.0, "vs": 0.1}


EFFECT = StribeckFriction()
