"""A torque sensor that also feels the bending moment across its axis."""

from collections.abc import Mapping

import numpy as np

from modelgen.effects.effect import Array, Columns, LinearParameter
from modelgen.effects.kinds import RecordingEffect
from modelgen.effects.loads import joint_moments
from modelgen.effects.memory import Memory
from modelgen.effects.place import Layout, Model, Motion, Place, PlaceSide
from modelgen.effects.truth import Stage, Truth


class BendingCrosstalk(RecordingEffect):
    """The sensor of a joint reads tau + gain_x n_x + gain_y n_y, n the moment across its axis in the joint's
    frame.

    The moment follows from the bodies beyond the joint. A fit knows these up to its base parameters only, and
    other bodies with the same torques have other bending moments: the columns are exact where the model's
    bodies are (a URDF's, CAD's), else of the bodies that the base parameters stand for, so gains are then
    indicative. A `sensor_crosstalk` from the next joint whose axis lies across this one's sees nearly the
    same moment.
    """

    name = "bending_crosstalk"
    summary = "a torque sensor also sees the bending moment across its axis"
    signature = "the residual of one sensor follows the weight of the arm beyond it, across its axis"
    source = "Aghili, Buehler, Hollerbach, Design of a hollow hexaform torque sensor, IJRR 20(12), 2001"
    equation = "recorded += gain_x n_x + gain_y n_y, n the moment at the joint in its frame"
    remedy = (
        "calibrate the sensor under bending, or support its bearing so that bending passes beside it; or "
        "measure the joint's axis, which shows the same where the robot file has it wrong by as many rad"
    )
    linear = (
        LinearParameter("gain_x", "-", -0.3, 0.3, share=True),
        LinearParameter("gain_y", "-", -0.3, 0.3, share=True),
    )
    channel = "sensor"
    stage: Stage = "crosstalk"
    typical = {"gain_x": 0.03, "gain_y": -0.02}
    common = False

    def sides(self, layout: Layout) -> tuple[PlaceSide, ...]:
        return ("sensor",) if "sensor" in layout.sides else ()

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """n_x and n_y at the joint, of the model's bodies."""
        assert place.joint is not None
        row = model.robot.moving[place.joint]
        n = joint_moments(model.robot, motion.q, motion.dq, motion.ddq, model.bodies(), row)
        return dict.fromkeys(place.rows(model.channels), n[:, :2])

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        assert place.joint is not None
        row = truth.robot.moving[place.joint]
        n = joint_moments(truth.robot, *truth.link, truth.standard, row)
        return tau + n[:, :2] @ np.array([values["gain_x"], values["gain_y"]])


EFFECT = BendingCrosstalk()
