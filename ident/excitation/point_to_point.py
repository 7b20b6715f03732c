"""The paper's motion, point to point with trapezoidal acceleration: the best of many random ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ident.excitation.holding import Holding
from ident.excitation.limits import ExcitationError
from ident.excitation.motion import FINE_HZ
from ident.excitation.optimal import Optimum
from ident.progress import Progress, silent
from ident.twin.trajectories import Motion, Reach, point_to_point

Array = np.ndarray
MOVE_S = 2.0  # of a move, as in the paper
DRAWS = 200


@dataclass(frozen=True)
class PointMotion:
    """A motion drawn towards its first posture by `share`, (n,): positions between limits stay there."""

    plan: Motion
    first: Array
    share: float = 1.0
    whole: tuple[Array, ...] = ()  # states of the plan at FINE_HZ, of every share

    @property
    def duration(self) -> float:
        return self.plan.duration

    @property
    def period(self) -> float:
        return self.plan.duration

    def states(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """q, dq, ddq, jerk (N, n); jerk by differences over a tenth of a millisecond."""
        return self._drawn(*_states(self.plan, t))

    @property
    def fine(self) -> tuple[Array, Array, Array, Array]:
        return self._drawn(*(self.whole or _states(self.plan, np.arange(0.0, self.period, 1 / FINE_HZ))))

    def _drawn(self, q: Array, dq: Array, ddq: Array, jerk: Array) -> tuple[Array, Array, Array, Array]:
        s = self.share
        return self.first + s * (q - self.first), s * dq, s * ddq, s * jerk

    @property
    def motion(self) -> Motion:
        return Motion("point_to_point", self.duration, lambda t: self.states(t)[:3])


def _states(plan: Motion, t: Array) -> tuple[Array, Array, Array, Array]:
    q, dq, ddq = plan.at(np.asarray(t, dtype=float))
    return q, dq, ddq, (plan.at(np.asarray(t) + 1e-4)[2] - ddq) / 1e-4


def best_of_random(
    holding: Holding,
    duration: float,
    value: Callable[[PointMotion], float],
    seed: int,
    start: Array | None = None,
    progress: Progress = silent,
    stop: Callable[[], bool] = lambda: False,
) -> Optimum:
    """The smallest value of DRAWS motions, each as large as its limits allow. Raises ExcitationError."""
    if duration < 2 * MOVE_S:
        raise ExcitationError(f"--duration {duration:g}: two moves take {2 * MOVE_S:g} s; give more.")
    bounds, rng = holding.bounds, np.random.default_rng([seed, 15])
    rest = holding.rest(start, rng)
    half = np.minimum(bounds.high - rest, rest - bounds.low) if start is not None else bounds.half
    space = Reach(rest if start is not None else bounds.middle, half, bounds.dq, bounds.ddq)
    best: tuple[float, PointMotion] | None = None
    for k in range(DRAWS):
        if stop() and best is not None:
            break
        progress("point to point", k / DRAWS)
        plan = point_to_point(space, max(round(duration / MOVE_S) - 1, 1), duration, rng)
        whole = _states(plan, np.arange(0.0, plan.duration, 1 / FINE_HZ))
        motion = PointMotion(plan, space.centre, whole=whole)
        for _ in range(12):
            used = holding.use(motion)[0]
            if used <= 1:
                break
            motion = replace(motion, share=motion.share * min(0.999 / used, 0.9))
        else:
            continue  # gravity at its first posture is too much already
        found = value(motion)
        if (best is None or found < best[0]) and holding.touching(motion) is None:
            best = (found, motion)
    if best is None:
        raise ExcitationError(f"no motion holds {holding.use(motion)[1]}; give another start or limit.")
    return Optimum(best[1], best[0], (), stop())
