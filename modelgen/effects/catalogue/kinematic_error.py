"""A gear that does not turn evenly: the link's position errs periodically, once or twice a turn of a
wheel."""

from collections.abc import Mapping, Sequence

import numpy as np
import sympy as sp

from modelgen.effects.carried import HIDDEN_ROTOR
from modelgen.effects.effect import SIGNALS, Array, Columns, LinearParameter, NonlinearParameter, Quantity
from modelgen.effects.kinds import MotionEffect
from modelgen.effects.memory import Memory
from modelgen.effects.motions import little_displaced
from modelgen.effects.periodic import beyond_an_error, peaks, travel_of, wavenumber_bounds, wavenumber_range
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.truth import Stage, Truth

k, es, ec, e, phi = sp.symbols("wavenumber es ec e phi", real=True)


class KinematicError(MotionEffect):
    """q_link = q + e sin(k q + phi): wavenumber 1 and 2 an eccentric output wheel, multiples of the gear's
    ratio its input (a harmonic drive errs twice a turn of its wave generator).

    The torque it makes is inertial, k^2 e dq^2, so it grows with the speed, which a `torque_ripple` does
    not. At wavenumber 1 it differs from `encoder_eccentricity` by the rotor alone.

    Where the rotor's inertia is regrouped into the link's (first joints), which part of it the wave moves is
    found with it: with none taken off, e was too small by the rotor's share of ZZ.
    """

    name = "kinematic_error"
    summary = "the gear transmits its position with a periodic error"
    signature = (
        "waves in the position whose torque grows with the speed's square, felt by other joints as well"
    )
    source = (
        "Ghorbel, Gandhi, Alpeter, On the kinematic error in harmonic drive gears, J. Mech. Des. 123(1), 2001"
    )
    remedy = "calibrate the gear's error against the link's position, or replace the eccentric wheel"
    terms = {"es": sp.sin(k * SIGNALS.q), "ec": sp.cos(k * SIGNALS.q)}  # q_link - q
    linear = (LinearParameter("es", "rad", -0.02, 0.02), LinearParameter("ec", "rad", -0.02, 0.02))
    nonlinear = (
        NonlinearParameter("wavenumber", "1/rad", 0.9, 400.0, (1.0, 2.0, 50.0, 100.0, 200.0)),
        HIDDEN_ROTOR,
    )
    reported = (
        Quantity("e", "rad", sp.sqrt(es**2 + ec**2)),
        Quantity("wavenumber", "1/rad", k),
        Quantity("phi", "rad", sp.atan2(ec, es), angle=True),
        Quantity("Iam", HIDDEN_ROTOR.unit, HIDDEN_ROTOR.symbol),
    )
    inverse = {"es": e * sp.cos(phi), "ec": e * sp.sin(phi)}
    sizes = ("e",)
    typical = {"e": 1e-3, "wavenumber": 2.0, "phi": 0.6, "Iam": 0.0}
    common = False

    def bounds(self, place: Place) -> dict[str, tuple[float, float]]:
        bounds = super().bounds(place)
        if not place.prismatic:
            return bounds
        return {**bounds, "wavenumber": wavenumber_bounds(place)}

    def starts(
        self,
        place: Place,
        motions: Sequence[Motion],
        residuals: Sequence[Array],
        model: Model | None = None,
    ) -> Sequence[dict[str, float]]:
        """Once and twice a turn, and the waves that the residual shows."""
        assert place.joint is not None
        low, high = wavenumber_range(travel_of(motions, place.joint), place.prismatic)
        found = peaks(motions, residuals, place.joint, low, high)
        once_or_twice = () if place.prismatic else (1.0, 2.0)
        return [dict(self.complete({"wavenumber": w})) for w in (*once_or_twice, *found)]

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """Torque per rad of a shift sin(kq) and cos(kq), with its exact rates; errors are small enough for
        the tangent (second order in e)."""
        shape = self.complete(theta)
        j, w = place.joint, shape["wavenumber"]
        assert j is not None
        q, dq, ddq = motion.q[:, j], motion.dq[:, j], motion.ddq[:, j]
        sin, cos, parts = np.sin(w * q), np.cos(w * q), []
        for x, slope in ((sin, w * cos), (cos, -w * sin)):
            shift = (x, slope * dq, slope * ddq - w * w * x * dq**2)
            parts.append(little_displaced(model, motion, j, shift, rotor=shape["Iam"]))
        return {c: np.stack([part[:, c] for part in parts], axis=1) for c in range(len(model.channels))}

    def physical(self, values: Mapping[str, float], model: Model | None = None) -> str | None:
        """No larger than gears and encoders err."""
        return beyond_an_error(values, self.linear[0].high) or super().physical(values, model)

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return ("link_motion",)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        assert place.joint is not None
        wave = values["wavenumber"] * truth.motor[0][:, place.joint]
        return truth.moved("link", place.joint, values["es"] * np.sin(wave) + values["ec"] * np.cos(wave))


EFFECT = KinematicError()
