"""Two harmonics of one gear frequency: a harmonic drive errs once and twice per motor turn."""

from collections.abc import Sequence

import sympy as sp

from modelgen.effects.effect import SIGNALS, Array, Effect, LinearParameter, NonlinearParameter, Quantity
from modelgen.effects.periodic import peaks, travel_of, wavenumber_bounds, wavenumber_range
from modelgen.effects.place import Model, Motion, Place

k, As1, Ac1, As2, Ac2 = sp.symbols("wavenumber As1 Ac1 As2 Ac2", real=True)
A1, A2, phi1, phi2 = sp.symbols("A1 A2 phi1 phi2", real=True)


class GearRipple(Effect):
    """Two harmonics of one gear frequency: a harmonic drive errs once and twice per motor turn."""

    name = "gear_ripple"
    summary = "a torque at a gear frequency of the position and at twice that frequency"
    signature = "two lines, one at twice the other, in the spectrum of the residual against the position"
    source = "Gandhi, Ghorbel, Dabney, CDC 2002; Tuttle and Seering, IEEE T-RA 12(3), 1996 (harmonic drives)"
    remedy = "compensate with this term; check the gear for a damaged or eccentric wheel"
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
        Quantity("phi1", "rad", sp.atan2(Ac1, As1), angle=True),
        Quantity("phi2", "rad", sp.atan2(Ac2, As2), angle=True),
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

    def bounds(self, place: Place) -> dict[str, tuple[float, float]]:
        """From the joint's own travel: a wave and a half over it, to the finest lead or tooth."""
        low, high = wavenumber_bounds(place)
        return {"wavenumber": (low, high / 2)}

    def starts(
        self,
        place: Place,
        motions: Sequence[Motion],
        residuals: Sequence[Array],
        model: Model | None = None,
    ) -> Sequence[dict[str, float]]:
        """Waves that the residual shows over the position."""
        assert place.joint is not None
        low, high = wavenumber_range(travel_of(motions, place.joint), place.prismatic)
        return [{"wavenumber": w} for w in peaks(motions, residuals, place.joint, low, high / 2)]


EFFECT = GearRipple()
