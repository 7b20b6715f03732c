"""A torque record that ends at a limit: the current sensor or its converter saturates."""

from collections.abc import Mapping, Sequence

import numpy as np
import sympy as sp

from modelgen.effects.effect import Array, Columns, LinearParameter, NonlinearParameter
from modelgen.effects.kinds import RecordingEffect
from modelgen.effects.memory import Memory
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.truth import Truth

limit, tau = sp.symbols("limit tau", real=True)


class CurrentSaturation(RecordingEffect):
    """The recorded torque is clipped at +-limit; `share` 1 is a clip, less a soft end of the range.

    Where more is recorded of what is beyond the limit than is missing, the scale bends there and does not
    end. (Of a sensor whose scale is a cubic a limit of which 9 % were missing was told, and another of 17 %.)

    It changes nothing below the limit, where a `drive_gain_error` changes all.
    """

    name = "current_saturation"
    summary = "the recorded torque does not go beyond a limit"
    signature = "the largest torques are missing, flat tops in the recording; nothing elsewhere"
    source = "IEEE Std 1241, Terminology and test methods for analog-to-digital converters (clipping)"
    equation = "recorded = tau + share (clip(tau, -limit, limit) - tau)"
    remedy = "leave the saturated samples out, move more gently, or widen the range of the current sensor"
    # clip(tau) - tau = (|tau + limit| - |tau - limit|)/2 - tau
    terms = {"share": (sp.Abs(tau + limit) - sp.Abs(tau - limit)) / 2 - tau}
    linear = (LinearParameter("share", "-", 0.5, 1.2, "positive"),)
    nonlinear = (NonlinearParameter("limit", "N m", 1e-2, 1e5, (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)),)
    sizes = ("limit",)
    proportional = False
    typical = {"share": 1.0, "limit": 20.0}
    common = False

    def starts(
        self,
        place: Place,
        motions: Sequence[Motion],
        residuals: Sequence[Array],
        model: Model | None = None,
    ) -> Sequence[dict[str, float]]:
        """The largest recorded torque and a little below it."""
        if model is None or any(m.measured is None for m in motions):
            return super().starts(place, motions, residuals)
        rows = list(place.rows(model.channels))
        top = max(float(np.nanmax(np.abs(m.measured[:, rows]))) for m in motions if m.measured is not None)
        return [{"limit": share * top} for share in (1.0, 0.97, 0.9, 0.8)]

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """What a clip takes off the torque that acts."""
        top, total = self.complete(theta)["limit"], model.total(motion)
        return {
            c: (np.clip(total[:, c], -top, top) - total[:, c])[:, None] for c in place.rows(model.channels)
        }

    def physical(self, values: Mapping[str, float], model: Model | None = None) -> str | None:
        if values.get("share", 1.0) < self.linear[0].low:
            return "more of what is beyond the limit is recorded than is missing, so that it is none"
        return super().physical(values, model)

    def recorded(self, tau: Array, truth: Truth, place: Place, values: Mapping[str, float]) -> Array:
        return tau + values["share"] * (np.clip(tau, -values["limit"], values["limit"]) - tau)


EFFECT = CurrentSaturation()
