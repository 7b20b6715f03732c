"""Torque that repeats with the position: cogging of the motor, meshing of the gear."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter, Quantity

k, As, Ac, A, phi = sp.symbols("wavenumber As Ac A phi", real=True)


class TorqueRipple(Effect):
    """Torque that repeats with the position: cogging of the motor, meshing of the gear."""

    name = "torque_ripple"
    summary = "a torque A sin(k q + phi) of fixed wavenumber k in the joint's position"
    signature = "periodic in the position whatever the speed; its frequency in time is k |dq|"
    source = "Gandhi, Ghorbel, Dabney, CDC 2002 (harmonic drives); Holtz and Springob, IEEE TIE 43(2), 1996"
    terms = {"As": sp.sin(k * SIGNALS.q), "Ac": sp.cos(k * SIGNALS.q)}
    linear = (LinearParameter("As", "N m", -50.0, 50.0), LinearParameter("Ac", "N m", -50.0, 50.0))
    nonlinear = (
        NonlinearParameter("wavenumber", "1/rad", 1.5, 400.0, tuple(1.5 + 0.25 * i for i in range(395))),
    )
    reported = (
        Quantity("A", "N m", sp.sqrt(As**2 + Ac**2)),
        Quantity("wavenumber", "1/rad", k),
        Quantity("phi", "rad", sp.atan2(Ac, As)),
    )
    inverse = {"As": A * sp.cos(phi), "Ac": A * sp.sin(phi)}
    typical = {"A": 2.0, "wavenumber": 12.0, "phi": 0.7}


EFFECT = TorqueRipple()
