"""The three kinds of effect that are no column of a joint's own signals: of the gear's motion, of the
recorder, of the whole arm. Each says where it may stand and when a simulator lets it act; their files say
the rest."""

from collections.abc import Iterable, Mapping

import numpy as np

from modelgen.effects.effect import Array, ChannelKind, Columns, Effect
from modelgen.effects.memory import Memory
from modelgen.effects.place import Layout, Model, Motion, Place, PlaceSide
from modelgen.effects.truth import Stage, Truth


class MotionEffect(Effect):
    """The link is not where the motor's encoder says; every torque of the arm feels it."""

    kind = "motion"
    channel = "link"
    share = 0.03
    SHIFT_CUTOFF_HZ = 3.0  # the shift's second derivative is noise above

    def places(self, layout: Layout) -> Iterable[Place]:
        """Each joint; not in model D (tau_m - tau_l), which sees nothing beyond the gear."""
        if layout.sides & {"motor", "sensor"}:
            for joint in range(layout.n):
                for parts in self.variants():
                    yield layout.place(joint, side="link", parts=parts)


class RecordingEffect(Effect):
    """What is recorded is not the torque that acts. One stage of the recorder, `stage`."""

    kind = "measurement"
    channel: ChannelKind = "any"
    stage: Stage = "gain"

    def sides(self, layout: Layout) -> tuple[PlaceSide, ...]:
        """Motor torques and sensors apart; a difference of the two (model D) does not show whose it is."""
        sides: list[PlaceSide] = []
        if "motor" in layout.sides and self.channel == "any":
            sides.append("motor")
        if "sensor" in layout.sides:
            sides.append("sensor")
        return tuple(sides)

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return (self.stage,)

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        """(N,) what is recorded of one joint's torque (N,)."""
        raise NotImplementedError

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        """Every channel of the place as it is recorded."""
        for side, tau in dict(truth.torque).items():
            if place.side in (None, side):
                out = tau.copy()
                for j in range(tau.shape[1]) if place.joint is None else [place.joint]:
                    out[:, j] = self.recorded(tau[:, j], truth, place, values)
                truth = truth.with_recorded(side, out)
        return truth


class LoadEffect(Effect):
    """Acts on the whole arm from outside or by gravity; motor and sensor both show it."""

    kind = "load"
    channel = "link"
    joints = "robot"

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return ("link_torque",)

    def places(self, layout: Layout) -> Iterable[Place]:
        """The whole robot; in each recording apart where it comes and goes."""
        if layout.sides & {"motor", "sensor"}:
            for recording in layout.recordings if self.windowed else (None,):
                yield layout.place(side="link", recording=recording)

    def joint_columns(self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model) -> Array:
        """(N, n, p) torques of every joint for one of each linear parameter in use, each sample by itself: of
        a motion only the samples from the first to the last one at which the load acts are asked."""
        raise NotImplementedError

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """The joints' columns in every channel of the joint, inside the place's recording and window."""
        gate = place.gate(motion.recording, motion.t)
        shape = (len(motion.t), len(self.parameters_of(place)))
        if not gate.any():
            return {c: np.zeros(shape) for c in place.rows(model.channels)}
        acting = np.flatnonzero(gate)
        inside = slice(acting[0], acting[-1] + 1)
        joints = self.joint_columns(place, self.complete(theta), motion.only(inside), model)
        joints = joints * gate[inside, None, None]
        made = {c: np.zeros(shape) for c in place.rows(model.channels)}
        for c, z in made.items():
            z[inside] = joints[:, model.channels[c].joint]
        return made
