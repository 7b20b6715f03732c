"""A motor whose torque has a part of another joint's in it."""

from collections.abc import Mapping

from modelgen.effects.catalogue.sensor_crosstalk import SensorCrosstalk
from modelgen.effects.effect import SIGNALS, Array, LinearParameter
from modelgen.effects.place import Layout, Place, PlaceSide
from modelgen.effects.truth import Truth


class TorqueShare(SensorCrosstalk):
    """Motors that turn links together: where joints are at q = C theta the motors' torques are C^T those of
    the joints, so that what a joint needs, its friction too, is in the torque of a second motor."""

    name = "torque_share"
    summary = "a motor's torque has a part of another joint's in it, as of a differential or a coupled wrist"
    signature = "the residual of one motor's torque is a scaled copy of another's torque"
    source = "virtual work of coupled drives: L.-W. Tsai, Robot Analysis, 1999, ch. 7 (wrist mechanisms)"
    equation = "recorded += gain tau_motor of the source joint"
    remedy = "give the torques joint by joint: take the share of the other joint off this channel"
    terms = {"gain": SIGNALS.tau_source}
    linear = (LinearParameter("gain", "-", -2.0, 2.0),)
    channel = "motor"
    typical = {"gain": 0.3}
    common = False

    def sides(self, layout: Layout) -> tuple[PlaceSide, ...]:
        return ("motor",) if "motor" in layout.sides else ()

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        assert place.source is not None
        return tau + values["gain"] * truth.torque["motor"][:, place.source]


EFFECT = TorqueShare()
