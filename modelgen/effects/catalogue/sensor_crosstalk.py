"""A torque sensor that also feels the torque of another joint."""

from collections.abc import Iterable, Mapping

from modelgen.effects.effect import SIGNALS, Array, ChannelKind, Columns, LinearParameter
from modelgen.effects.kinds import RecordingEffect
from modelgen.effects.memory import Memory
from modelgen.effects.place import Layout, Model, Motion, Place
from modelgen.effects.truth import Stage, Truth


class SensorCrosstalk(RecordingEffect):
    """A torque sensor also sees another joint's torque."""

    name = "sensor_crosstalk"
    summary = "a torque sensor also sees a part of another joint's torque"
    signature = "the residual of one sensor is a scaled copy of another sensor's torque"
    source = "Aghili, Buehler, Hollerbach, Design of a hollow hexaform torque sensor, IJRR 20(12), 2001"
    equation = "recorded += gain tau_link of the source joint"
    remedy = "calibrate the sensors together, and take the share of the other joint off this channel"
    terms = {"gain": SIGNALS.tau_source}
    linear = (LinearParameter("gain", "-", -0.5, 0.5, share=True),)
    channel: ChannelKind = "sensor"
    joints = "pair"
    stage: Stage = "crosstalk"
    typical = {"gain": 0.05}

    def places(self, layout: Layout) -> Iterable[Place]:
        """Channels whose source is measured on the same side, too."""
        seen = {c.joint for c in layout.channels if c.side == self.channel}
        return [place for place in super().places(layout) if place.source in seen]

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """The other joint's torque on that side of its gear."""
        sources = {c.joint: k for k, c in enumerate(model.channels) if c.side == self.channel}
        assert place.source is not None
        other = model.total(motion)[:, [sources[place.source]]]
        return dict.fromkeys(place.rows(model.channels), other)

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        assert place.source is not None
        return tau + values["gain"] * truth.tau_link[:, place.source]


EFFECT = SensorCrosstalk()
