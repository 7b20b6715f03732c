"""Torque recorded at another time than position: two devices, two clocks, a filter in the drive."""

from collections.abc import Iterable, Mapping

import numpy as np

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
    told_by = ("channel_delay",)
    source = "Gautier, Dynamic identification of robots with power model, ICRA 1997 (phase shifts)"
    equation = "recorded(t) = tau(t - delay)"
    remedy = "take the delay from the torque's stamps (add a negative one), or record both with one clock"
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
        """[tau(t - delay) - tau(t)]/delay of the torque that acts, a cubic through the four samples about an
        instant, -d tau/dt at 0.

        Outside the stretch the torque is held; `margin_s` is what that spoils.
        """
        delay = float(size[0]) if size is not None else 0.0
        total, out = model.total(motion), {}
        for c in place.rows(model.channels):
            if len(motion.t) < 4:
                out[c] = np.zeros((len(motion.t), 1))
                continue
            if abs(delay) < LITTLE:
                change = -np.gradient(total[:, c], motion.t)
            else:
                change = (_then(total[:, c], delay * motion.rate_hz) - total[:, c]) / delay
            out[c] = change[:, None]
        return out

    def late(self, size: Array) -> float:
        return float(size[0])

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        """As it was `delay` ago; before the first sample, the first."""
        if values["delay"] == 0:
            return tau
        return np.interp(truth.t - values["delay"], truth.t, tau)


def _then(tau: Array, samples: float) -> Array:
    """(N,) tau (N,) so many samples ago (Lagrange's cubic; at the ends the first and the last are held)."""
    N, whole = len(tau), int(np.floor(samples))
    u = 1 - (samples - whole)
    weights = (
        -u * (u - 1) * (u - 2) / 6,
        (u + 1) * (u - 1) * (u - 2) / 2,
        -(u + 1) * u * (u - 2) / 2,
        (u + 1) * u * (u - 1) / 6,
    )
    whole = min(max(whole, -N - 1), N + 1)
    ends = np.concatenate((np.full(max(whole + 2, 0), tau[0]), tau, np.full(max(1 - whole, 0), tau[-1])))
    first = max(-whole - 2, 0)
    return np.asarray(sum(w * ends[first + k : first + k + N] for k, w in enumerate(weights)))


EFFECT = TimeDelay()
