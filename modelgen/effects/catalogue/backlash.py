"""Free play of a gear: after a reversal the motor crosses the gap before the link follows."""

from collections.abc import Mapping

import numpy as np
import sympy as sp

from modelgen.effects.effect import (
    SIGNALS,
    Array,
    Columns,
    LinearParameter,
    NonlinearParameter,
    Quantity,
    State,
)
from modelgen.effects.kinds import MotionEffect
from modelgen.effects.memory import Memory
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.states import integrate_play
from modelgen.effects.truth import Stage, Truth

gap, travel, drop = sp.symbols("gap travel drop", real=True)
moved = SIGNALS.z + 2 * SIGNALS.step / travel

# The play operator: z is the motor's place inside the gap, -1 and +1 are the two flanks.
PLAY = State(update=(sp.Abs(moved + 1) - sp.Abs(moved - 1)) / 2, integrate=integrate_play, low=-1.0, high=1.0)

# 1 between the flanks, 0 on them: 1 - clip(5 |z| - 4, 0, 1)
near = 5 * sp.Abs(SIGNALS.z) - 4
crossing = 1 - (sp.Abs(near) - sp.Abs(near - 1) + 1) / 2


class Backlash(MotionEffect):
    """Free play of the gear around reversals."""

    name = "backlash"
    summary = "the link rests while the motor crosses the free play of the gear after each reversal"
    signature = "short pulses after reversals; position torques shift by half the gap with the direction"
    source = "Nordin and Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38, 2002"
    equation = "q_link = q - gap z/2, z the place in the gap; tau -= drop tau_link while it is crossed"
    remedy = "adjust or replace the gear; until then approach positions from one side"
    terms = {
        "gap": -SIGNALS.z / 2,  # q_link - q
        "drop": -SIGNALS.tau_link * crossing,  # share of the link's torque not passed on meanwhile
    }
    linear = (
        LinearParameter("gap", "rad", 0.0, 0.1, "positive"),
        LinearParameter("drop", "-", 0.0, 1.2, "positive", optional=True),
    )
    nonlinear = (NonlinearParameter("travel", "rad", 1e-5, 0.1, (3e-4, 1e-3, 3e-3, 0.01, 0.03)),)
    reported = (Quantity("gap", "rad", gap), Quantity("drop", "-", drop))
    inverse = {"travel": gap}
    one_quantity = {"gap": "travel"}  # the motor crosses what the link lags
    state = PLAY
    sizes = ("gap",)
    proportional = False
    typical = {"gap": 2e-3, "drop": 0.0}
    told_by = ("torque_drop",)  # checks of a recording that are this effect

    def variants(self) -> tuple[tuple[str, ...], ...]:
        """Gravity need not show the shift, nor the gear a drop."""
        return (("gap",), ("gap", "drop"), ("drop",))

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """gap: position torques of the shifted link (its impacts are too short for the rows); drop: the
        joint's torque that is not passed on while the motor crosses the gap."""
        j = place.joint
        assert j is not None
        z = self.states(motion.way(j), self.complete(theta), motion.recording, memory, place)["z"]
        parts = {}
        if "gap" in self.parameters_of(place):
            parts["gap"] = model.slopes(motion, j)[0] * (-0.5 * z)[:, None]
        if "drop" in self.parameters_of(place):
            open_gap = 1.0 - np.clip(5.0 * np.abs(z) - 4.0, 0.0, 1.0)
            own = np.array([c.joint == j and c.side != "drive" for c in model.channels], dtype=float)
            parts["drop"] = (-model.link_torque(motion)[:, j] * open_gap)[:, None] * own
        return {
            c: np.stack([parts[name][:, c] for name in self.parameters_of(place)], axis=1)
            for c in range(len(model.channels))
        }

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return ("link_motion", "link_torque")

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        """The link follows a play operator; what an open gap does not pass on is missing."""
        j = place.joint
        assert j is not None
        if truth.stage == "link_torque":
            lost = self._torque(truth, Place(j, side="motor"), values, only=("drop",))
            return truth.with_torque(place, lost)
        theta = {"travel": values["travel"]}
        lag = -integrate_play(truth.motor[0][:, j], theta) / 2 * values["gap"]
        return truth.moved("link", j, truth.smooth(lag))


EFFECT = Backlash()
