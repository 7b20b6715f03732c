"""A zero that wanders: strain gauges and amplifiers drift while they warm."""

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class OffsetDrift(Effect):
    """A zero that wanders: strain gauges and amplifiers drift while they warm."""

    name = "offset_drift"
    summary = "the offset of the measured torque moves with time"
    signature = "a straight line against time, in every recording, whatever the motion"
    source = "Hollerbach, Khalil, Gautier, Model Identification, Springer Handbook of Robotics, 2008"
    remedy = "warm the sensor up before recording, or zero it between recordings"
    terms = {"slope": SIGNALS.t}
    linear = (LinearParameter("slope", "N m/s", -1.0, 1.0),)
    channel = "any"
    typical = {"slope": 0.03}


EFFECT = OffsetDrift()
