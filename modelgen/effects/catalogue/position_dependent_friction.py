"""Dry friction that varies over the turn of a joint: an eccentric gear, a tight spot."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter, Quantity

k, Fs, Fk, F, phi = sp.symbols("wavenumber Fqs Fqc F phi", real=True)


class PositionDependentFriction(Effect):
    """Dry friction that varies over the turn of a joint: an eccentric gear, a tight spot."""

    name = "position_dependent_friction"
    summary = "dry friction is higher in some positions of the joint than in others"
    signature = "changes sign with the rate, and its size is a wave in the position"
    source = "Armstrong, Friction: experimental determination, modeling and compensation, ICRA 1988"
    remedy = "check the joint for a tight spot or an eccentric bearing; compensate with this term"
    terms = {"Fqs": sp.sin(k * SIGNALS.q) * SIGNALS.sign_dq, "Fqc": sp.cos(k * SIGNALS.q) * SIGNALS.sign_dq}
    linear = (LinearParameter("Fqs", "N m", -50.0, 50.0), LinearParameter("Fqc", "N m", -50.0, 50.0))
    nonlinear = (NonlinearParameter("wavenumber", "1/rad", 0.8, 12.0, (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)),)
    reported = (
        Quantity("F", "N m", sp.sqrt(Fs**2 + Fk**2)),
        Quantity("wavenumber", "1/rad", k),
        Quantity("phi", "rad", sp.atan2(Fk, Fs), angle=True),
    )
    inverse = {"Fqs": F * sp.cos(phi), "Fqc": F * sp.sin(phi)}
    typical = {"F": 1.5, "wavenumber": 2.0, "phi": 0.5}
    common = False


EFFECT = PositionDependentFriction()
