"""Two harmonics of one gear frequency: a harmonic drive errs once and twice per motor turn."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter, Quantity

k, As1, Ac1, As2, Ac2 = sp.symbols("wavenumber As1 Ac1 As2 Ac2", real=True)
A1, A2, phi1, phi2 = sp.symbols("A1 A2 phi1 phi2", real=True)


class GearRipple(Effect):
    """Two harmonics of one gear frequency: a harmonic drive errs once and twice per motor turn."""

    name = "gear_ripple"
    summary = "a torque at a gear frequency of the position and at twice that frequency"
    signature = "two lines, one at twice the other, in the spectrum of the residual against the position"
    source = "Gandhi, Ghorbel, Dabney, CDC 2002; Tuttle and Seering, IEEE T-RA 12(3), 1996 (harmonic drives)"
    terms = {
        "As1": sp.sin(k * SIGNALS.q),
        "Ac1": sp.cos(k * SIGNALS.q),
        "As2": sp.sin(2 * k * SIGNALS.q),
        "Ac2": sp.cos(2 * k * SIGNALS.q),
    }
    linear = tuple(LinearParameter(name, "N m", -50.0, 50.0) for name in ("As1", "Ac1", "As2", "Ac2"))
    nonlinear = (
        NonlinearParameter("wavenumber", "1/rad", 1.5, 125.0, tuple(1.5 + 0.25 * i for i in range(195))),
    )
    reported = (
        Quantity("A1", "N m", sp.sqrt(As1**2 + Ac1**2)),
        Quantity("A2", "N m", sp.sqrt(As2**2 + Ac2**2)),
        Quantity("wavenumber", "1/rad", k),
        Quantity("phi1", "rad", sp.atan2(Ac1, As1)),
        Quantity("phi2", "rad", sp.atan2(Ac2, As2)),
    )
    inverse = {
        "As1": A1 * sp.cos(phi1),
        "Ac1": A1 * sp.sin(phi1),
        "As2": A2 * sp.cos(phi2),
        "Ac2": A2 * sp.sin(phi2),
    }
    typical = {"A1": 1.5, "A2": 1.2, "wavenumber": 9.0, "phi1": 0.4, "phi2": -0.9}
    sizes = ("A1", "A2")
    common = False


EFFECT = GearRipple()
