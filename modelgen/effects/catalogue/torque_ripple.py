"""Torque that repeats with the position: cogging of the motor, meshing of the gear."""

from collections.abc import Sequence

import sympy as sp

from modelgen.effects.effect import SIGNALS, Array, Effect, LinearParameter, NonlinearParameter, Quantity
from modelgen.effects.periodic import peaks, travel_of, wavenumber_bounds, wavenumber_range
from modelgen.effects.place import Model, Motion, Place

k, As, Ac, A, phi = sp.symbols("wavenumber As Ac A phi", real=True)


class TorqueRipple(Effect):
    """Torque that repeats with the position: cogging of the motor, meshing of the gear."""

    name = "torque_ripple"
    summary = "a torque A sin(k q + phi) of fixed wavenumber k in the joint's position"
    signature = "periodic in the position whatever the speed; its frequency in time is k |dq|"
    source = "Gandhi, Ghorbel, Dabney, CDC 2002 (harmonic drives); Holtz and Springob, IEEE TIE 43(2), 1996"
    remedy = "compensate with this term; check the motor's commutation and the gear's teeth"
    terms = {"As": sp.sin(k * SIGNALS.q), "Ac": sp.cos(k * SIGNALS.q)}
    linear = (LinearParameter("As", "N m", -50.0, 50.0), LinearParameter("Ac", "N m", -50.0, 50.0))
    nonlinear = (
        NonlinearParameter("wavenumber", "1/rad", 1.5, 400.0, tuple(1.5 + 0.25 * i for i in range(395))),
    )
    reported = (
        Quantity("A", "N m", sp.sqrt(As**2 + Ac**2)),
        Quantity("wavenumber", "1/rad", k),
        Quantity("phi", "rad", sp.atan2(Ac, As), angle=True),
    )
    inverse = {"As": A * sp.cos(phi), "Ac": A * sp.sin(phi)}
    typical = {"A": 2.0, "wavenumber": 12.0, "phi": 0.7}

    def bounds(self, place: Place) -> dict[str, tuple[float, float]]:
        """From the joint's own travel: a wave and a half over it, to the finest lead or tooth."""
        return {"wavenumber": wavenumber_bounds(place)}

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
        return [{"wavenumber": w} for w in peaks(motions, residuals, place.joint, low, high)]


EFFECT = TorqueRipple()
