"""A recorded torque that follows the true one with a first-order lag: a low-pass in the drive or the
logger."""

from collections.abc import Mapping

import numpy as np

from modelgen.effects.effect import SIGNALS, Array, Columns, LinearParameter
from modelgen.effects.kinds import RecordingEffect
from modelgen.effects.memory import Memory, carried
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.truth import Stage, Truth

LITTLE = 1e-5  # s


class TorqueLag(RecordingEffect):
    """The recorded torque y obeys T dy/dt = tau - y.

    Its tangent -d tau/dt is that of `time_delay`: only motion that is fast against T tells the two apart.
    """

    name = "torque_lag"
    summary = "the recorded torque follows the true one with a first-order lag"
    signature = "the residual follows the torque's own derivative; steps of friction are rounded, not shifted"
    told_by = ("channel_delay",)
    source = "Ljung, System Identification: Theory for the User, 2nd ed. 1999, ch. 14 (prefilters)"
    equation = "time_constant d recorded/dt = tau - recorded"
    remedy = "record the torque before the drive's low-pass, or filter the positions with the same lag"
    terms = {"time_constant": -SIGNALS.dtau}  # first order; columns and simulator filter exactly
    linear = (LinearParameter("time_constant", "s", 0.0, 0.2, "positive"),)
    stage: Stage = "lag"
    typical = {"time_constant": 0.01}
    common = False

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """(y - tau)/T with the lag's exact response to a torque that is linear between samples."""
        T = float(size[0]) if size is not None else 0.0
        total, out = model.total(motion), {}
        for c in place.rows(model.channels):
            tau = total[:, c]
            if T < LITTLE:
                out[c] = -np.gradient(tau, 1.0 / motion.rate_hz)[:, None]
                continue
            key = (self.name, place, c)

            def follow(drive: Array, first: float) -> Array:
                return lagged(drive, T, 1.0 / motion.rate_hz, first)

            y = carried(memory, key, motion.recording, motion.t, tau, follow, float("nan"))
            out[c] = ((y - tau) / T)[:, None]
        return out

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        T = values["time_constant"]
        return lagged(tau, T, truth.dt) if T > LITTLE else tau


def lagged(tau: Array, T: float, dt: float, first: float = float("nan")) -> Array:
    """(N,) y of T dy/dt = tau - y for tau (N,) linear between its samples; y begins at `first`, or at tau."""
    a = np.exp(-dt / T)
    after = 1.0 - (T / dt) * (1.0 - a)  # weight of the new sample, of the old one: 1 - a - after
    y0 = tau[0] if np.isnan(first) else first
    drive = (1.0 - a - after) * tau[:-1] + after * tau[1:]
    if not len(drive):
        return np.full(1, y0)
    from scipy.signal import lfilter  # whatever else a study asks for does without

    rest, _ = lfilter([1.0], [1.0, -a], drive, zi=np.array([a * y0]))
    return np.concatenate(([y0], rest))


EFFECT = TorqueLag()
