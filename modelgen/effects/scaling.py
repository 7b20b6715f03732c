"""Ranges and signs of a joint: what a rad is on one that slides, the sign of two joints' summed rate."""

from collections.abc import Sequence

import numpy as np

from modelgen.effects.place import REVOLUTE_TRAVEL, USUAL_SLIDE, Motion, Place


def radian_power(unit: str) -> int:
    """Power of the joint's position in a unit: rad/s 1, 1/rad -1, N m/rad 0 (its N m scales as well)."""
    if "N m" in unit:
        return 0
    return {"rad": 1, "rad/s": 1, "1/rad": -1}.get(unit, 0)


def metres_per_radian(place: Place, motions: Sequence[Motion] = ()) -> float:
    """1 of a joint that turns; of one that slides, its travel [m] over that of a usual revolute joint."""
    j = place.source if place.source is not None else place.joint
    slides = place.prismatic if place.source is None else bool(place.source_prismatic)
    if j is None or not slides:
        return 1.0
    travel = place.travel if place.source is None else place.source_travel
    if travel is None:
        span = [(m.q[:, j].min(), m.q[:, j].max()) for m in motions if len(m.t)]
        travel = max(h for _, h in span) - min(low for low, _ in span) if span else USUAL_SLIDE
    return max(travel, 1e-3) / REVOLUTE_TRAVEL  # one that rests has gone nowhere


def sign_of_sum(motion: Motion, j: int, source: int) -> np.ndarray:
    """(N,) sign(dq_j + dq_source), as smooth as the signs of the two joints are: tanh of the same width."""
    width = 0.0
    for k in (j, source):
        sign, dq = motion.sign_dq[:, k], motion.dq[:, k]
        inside = (np.abs(sign) > 0.05) & (np.abs(sign) < 0.95)
        if inside.any():
            width = max(width, float(np.median(dq[inside] / np.arctanh(sign[inside]))))
    total = motion.dq[:, j] + motion.dq[:, source]
    return np.tanh(total / width) if width > 0 else np.sign(total)
