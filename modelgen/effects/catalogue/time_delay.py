"""Torque recorded at another time than position: two devices, two clocks, a filter in the drive."""

from collections.abc import Iterable, Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from modelgen.effects.effect import SIGNALS, Array, Columns, LinearParameter
from modelgen.effects.kinds import RecordingEffect
from modelgen.effects.memory import Memory
from modelgen.effects.place import Layout, Model, Motion, Place
from modelgen.effects.truth import Stage, Truth

LITTLE = 1e-5  # s


class TimeDelay(RecordingEffect):
    """Torque is recorded `delay` later than position; negative: earlier.

    Its tangent -d tau/dt is that of `torque_lag`: slow motion does not tell the two apart.
    """

    name = "time_delay"
    summary = "the torque is recorded a fixed time after the position, or before it"
    signature = "the residual follows the torque's own derivative, most at reversals where friction jumps"
    source = "Gautier, Dynamic identification of robots with power model, ICRA 1997 (phase shifts)"
    equation = "recorded(t) = tau(t - delay)"
    remedy = "shift the torque's time stamps back by the delay, or record both with one clock"
    terms = {"delay": -SIGNALS.dtau}  # first order; columns and simulator shift exactly
    linear = (LinearParameter("delay", "s", -0.1, 0.1),)
    shared = True
    stage: Stage = "delay"
    typical = {"delay": 0.006}
    margin_s = 0.12

    def places(self, layout: Layout) -> Iterable[Place]:
        """All torques of a kind together, all at once, and each joint's alone."""
        sides = self.sides(layout)
        for side in (None,) if len(sides) == 1 else (None, *sides):
            yield layout.place(side=side)
        yield from super().places(layout)

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """[tau(t - delay) - tau(t)]/delay of a cubic spline through the torque that acts, -d tau/dt at 0.

        Outside the stretch the torque is held; `margin_s` is what that spoils.
        """
        delay = float(size[0]) if size is not None else 0.0
        total, out = model.total(motion), {}
        for c in place.rows(model.channels):
            if len(motion.t) < 4:
                out[c] = np.zeros((len(motion.t), 1))
                continue
            spline = CubicSpline(motion.t, total[:, c])
            if abs(delay) < LITTLE:
                change = -spline(motion.t, 1)
            else:
                then = np.clip(motion.t - delay, motion.t[0], motion.t[-1])
                change = (spline(then) - total[:, c]) / delay
            out[c] = change[:, None]
        return out

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        """As it was `delay` ago; before the first sample, the first."""
        if values["delay"] == 0:
            return tau
        return np.interp(truth.t - values["delay"], truth.t, tau)


EFFECT = TimeDelay()
