"""A base that is not level: gravity is not where the robot file says."""

import sympy as sp

from modelgen.effects.effect import Effect, LinearParameter

EFFECT = Effect(
    name="base_tilt",
    summary="the base is rolled and pitched, so gravity is not where the robot file puts it",
    signature="gravity torques of the first joints: joint 1 of an upright arm carries sin and cos of q1",
    source="gravity is an acceleration of the base: Luh, Walker, Paul, J. Dyn. Sys. Meas. Control 102, 1980",
    # the base stands at Ry(pitch) Rx(roll) from where the file has it: g = (Ry Rx)^T g_file in base axes
    terms={"roll": sp.Integer(1), "pitch": sp.Integer(1)},
    linear=(LinearParameter("roll", "rad", -0.6, 0.6), LinearParameter("pitch", "rad", -0.6, 0.6)),
    kind="load",
    channel="link",
    joints="robot",
    typical={"roll": 0.03, "pitch": -0.04},
)
