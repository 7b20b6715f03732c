"""A joint whose position counts from another zero in one recording: homed anew, a belt that
jumped a tooth."""

from collections.abc import Iterable, Mapping

import numpy as np

from modelgen.effects.effect import SIGNALS, Array, Columns, LinearParameter
from modelgen.effects.kinds import MotionEffect
from modelgen.effects.memory import Memory
from modelgen.effects.motions import displaced_torque, little_displaced
from modelgen.effects.place import Layout, Model, Motion, Place
from modelgen.effects.truth import Stage, Truth

LITTLE = 1e-6  # rad, of which the tangent is all


class PositionZero(MotionEffect):
    """Recorded q is the true one plus a constant, in one recording from its first sample to its last.

    In all recordings alike it would be the geometry's own zero. Columns are secants of the model's torque, as
    gravity is bent by some degrees; rotor and friction do not feel a constant.
    """

    name = "position_zero"
    told_by = ("position_zero",)  # checks of a recording that are this effect
    summary = "a joint's position counts from another zero in one recording"
    signature = "gravity and inertia of one recording are those of another pose of one joint"
    source = (
        "Hollerbach, Khalil, Gautier, Model Identification, Springer Handbook of Robotics, 2008 (offsets)"
    )
    equation = "recorded q = q + zero in one recording"
    remedy = "give this recording a `columns:` of its own with {qJ: {offset: -zero}}, or home it again"
    terms = {"zero": -SIGNALS.gate}  # true - recorded
    linear = (LinearParameter("zero", "rad", -np.pi, np.pi),)
    windowed = True
    all_along = True
    typical = {"zero": 0.05}

    def places(self, layout: Layout) -> Iterable[Place]:
        """Each joint in each recording."""
        if layout.sides & {"motor", "sensor"}:
            for recording in layout.recordings:
                for joint in range(layout.n):
                    yield layout.place(joint, side="link", recording=recording)

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """[tau(q - zero) - tau(q)] / zero in every channel, -d tau/dq at 0."""
        assert place.joint is not None
        gate = place.gate(motion.recording, motion.t)[:, None]
        channels = range(len(model.channels))
        if not gate.any():
            return {c: np.zeros_like(gate) for c in channels}
        zero = 0.0 if size is None else float(size[0])
        still = np.zeros(len(motion.t))
        if abs(zero) < LITTLE:
            unit = (still - 1.0, still, still)
            change = little_displaced(model, motion, place.joint, unit, drive_follows=True)
        else:
            shift = (still - zero, still, still)
            change = displaced_torque(model, motion, place.joint, shift, drive_follows=True) / zero
        return {c: gate * change[:, [c]] for c in channels}

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return ("encoder",)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        assert place.joint is not None and truth.encoder is not None
        q = truth.encoder.copy()
        q[:, place.joint] += values["zero"]
        return truth.with_encoder(q)


EFFECT = PositionZero()
