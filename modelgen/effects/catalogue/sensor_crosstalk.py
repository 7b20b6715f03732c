"""A torque sensor that also feels the torque of another joint."""

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter

EFFECT = Effect(
    name="sensor_crosstalk",
    summary="a torque sensor also sees a part of another joint's torque",
    signature="the residual of one sensor is a scaled copy of another sensor's torque",
    source="Aghili, Buehler, Hollerbach, Design of a hollow hexaform torque sensor, IJRR 20(12), 2001",
    terms={"gain": SIGNALS.tau_source},
    linear=(LinearParameter("gain", "-", -0.5, 0.5),),
    kind="measurement",
    channel="sensor",
    joints="pair",
    typical={"gain": 0.05},
)
