"""An encoder disc off its axis: the recorded position errs once a turn."""

from collections.abc import Iterable, Mapping

import numpy as np
import sympy as sp

from modelgen.effects.effect import SIGNALS, Array, Columns, LinearParameter, Quantity
from modelgen.effects.kinds import MotionEffect
from modelgen.effects.memory import Memory
from modelgen.effects.motions import little_displaced
from modelgen.effects.periodic import beyond_an_error
from modelgen.effects.place import Layout, Model, Motion, Place
from modelgen.effects.truth import Stage, Truth

es, ec, e, phi = sp.symbols("es ec e phi", real=True)


class EncoderEccentricity(MotionEffect):
    """Recorded q is the true one plus e sin(q + phi), on an encoder of the joint's own turn.

    Bodies, rotor and friction move with the true position; `kinematic_error` at wavenumber 1 leaves the rotor
    with the recorded one and has the other sign. Gravity alone does not tell the two apart.
    """

    name = "encoder_eccentricity"
    summary = "the joint's encoder disc is off its axis, so the recorded position errs once a turn"
    signature = "gravity torques distorted once a turn, at any speed"
    source = (
        "Whitney, Lozinski, Rourke, Industrial robot forward calibration method and results, J. Dyn. "
        "Sys. Meas. "
        "Control 108(1), 1986 (periodic errors of a joint)"
    )
    equation = "recorded q = q + e sin(q + phi)"
    remedy = "centre the disc, read it with two opposite heads, or take e sin(q + phi) off the positions"
    terms = {"es": -sp.sin(SIGNALS.q), "ec": -sp.cos(SIGNALS.q)}  # true - recorded
    linear = (LinearParameter("es", "rad", -0.02, 0.02), LinearParameter("ec", "rad", -0.02, 0.02))
    reported = (
        Quantity("e", "rad", sp.sqrt(es**2 + ec**2), angle=True),
        Quantity("phi", "rad", sp.atan2(ec, es), angle=True),
    )
    inverse = {"es": e * sp.cos(phi), "ec": e * sp.sin(phi)}
    sizes = ("e",)
    typical = {"e": 2e-3, "phi": 0.6}
    common = False

    def places(self, layout: Layout) -> Iterable[Place]:
        """Joints that turn."""
        return [place for place in super().places(layout) if not place.prismatic]

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """Torque per rad of a true position at -sin q and -cos q from the recorded one."""
        j = place.joint
        assert j is not None
        q, dq, ddq = motion.q[:, j], motion.dq[:, j], motion.ddq[:, j]
        sin, cos, parts = np.sin(q), np.cos(q), []
        for x, slope in ((sin, cos), (cos, -sin)):
            shift = (-x, -slope * dq, x * dq**2 - slope * ddq)
            parts.append(little_displaced(model, motion, j, shift, drive_follows=True))
        return {c: np.stack([part[:, c] for part in parts], axis=1) for c in range(len(model.channels))}

    def physical(self, values: Mapping[str, float], model: Model | None = None) -> str | None:
        """No larger than gears and encoders err."""
        return beyond_an_error(values, self.linear[0].high) or super().physical(values, model)

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return ("encoder",)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        assert place.joint is not None and truth.encoder is not None
        q = truth.encoder.copy()
        true = q[:, place.joint]
        q[:, place.joint] = true + values["es"] * np.sin(true) + values["ec"] * np.cos(true)
        return truth.with_encoder(q)


EFFECT = EncoderEccentricity()
