"""Whether a robot can hold a motion: limits at every sample of 1 kHz, boxes, its own bodies.

A motion that is a little outside, or was interrupted, is drawn towards a posture of rest that is inside:
positions then stay between limits and all rates shrink, so there is always a last step that holds.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

import generated
from ident.excitation.limits import Bounds, ExcitationError
from ident.excitation.motion import Basis, FourierMotion, Planned
from ident.excitation.obstacles import KeepOut
from ident.excitation.self_collision import SelfCollision
from modelgen.effects.frames import frames
from modelgen.geometry.robot import Robot

Array = np.ndarray
NEAR = 0.1  # m from a box at which its use begins to count
COARSE = 20  # one sample in so many is looked at while searching
LESS = np.array([1.0, 0.998, 0.99, 0.95, 0.8, 0.5, 0.2])


@dataclass(frozen=True)
class Holding:
    """Whether a robot can hold a motion: its limits, and its motor torques where its parameters are known."""

    bounds: Bounds
    model: generated.Model | None = None  # of the motor torques
    chi: Array = field(default_factory=lambda: np.zeros(0))
    dry: Array = field(default_factory=lambda: np.zeros(0))  # (n,) Coulomb friction, N m
    robot: Robot | None = None
    keep_out: KeepOut | None = None
    bodies: SelfCollision | None = None

    @property
    def limited(self) -> bool:
        return self.model is not None and bool(np.isfinite(self.bounds.tau).any())

    @property
    def obstacles(self) -> list[KeepOut | SelfCollision]:
        """What has a clearance to keep while designing."""
        bodies = self.bodies if self.bodies is not None and self.bodies.smooth_pairs else None
        return [its for its in (self.keep_out, bodies) if its is not None]

    @property
    def smooth(self) -> Array:
        """(n,) what the torque without dry friction may reach."""
        return np.maximum(self.bounds.tau - self.dry, 1e-9)

    def torque(self, states: tuple[Array, ...]) -> Array | None:
        """(N, n) largest motor torque of either sign of dry friction."""
        if not self.limited or self.model is None:
            return None
        q, dq, ddq = states[:3]
        tau = self.model.torque(q, dq, ddq, self.chi, sign=np.zeros_like(q))
        return np.abs(tau) + self.dry

    def use(self, motion: Planned) -> tuple[float, str]:
        """(largest use of a limit over one period, in words)."""
        return self._use(motion.fine)

    def _use(self, states: tuple[Array, ...]) -> tuple[float, str]:
        used = self.bounds.excess(states, self.torque(states))
        if self.keep_out is None or self.robot is None:
            return used
        beyond = self.keep_out.exact(frames(self.robot, states[0])).min(axis=0)
        k = int(np.argmin(beyond))
        return max(used, (max(1 - float(beyond[k]) / NEAR, 0.0), self.keep_out.told(k)))

    def holds(self, motion: Planned) -> bool:
        """All limits at every sample, outside of every box, and the robot does not touch itself."""
        return self.use(motion)[0] <= 1 and self.touching(motion) is None

    def touching(self, motion: Planned) -> tuple[int, str] | None:
        return None if self.bodies is None else self.bodies.touching(motion.fine[0])

    def rest(self, start: Array | None, rng: np.random.Generator) -> Array:
        """(n,) a posture that can be held. Raises ExcitationError naming the limit that forbids it."""
        bounds = self.bounds
        tries = [bounds.middle, *rng.uniform(bounds.low, bounds.high, (200, len(bounds.low)))]
        tries = [start] if start is not None else tries
        zero, best = np.zeros((1, len(bounds.low))), (np.inf, "", bounds.middle)
        for posture in tries:
            used, told = self._use((posture[None], zero, zero, zero))
            touch = self.bodies.touching(posture[None]) if self.bodies is not None else None
            if touch is not None:
                used, told = 2.0 + used, f"self-collision of {touch[1]}"
            if used < 0.9 or (start is not None and used <= 1):
                return posture
            best = min(best, (used, told, posture), key=lambda entry: entry[0])
        if start is None and best[0] <= 1:
            return best[2]
        whose = "the start" if start is not None else "every posture that was tried"
        raise ExcitationError(f"{whose} is forbidden by {best[1]}; choose another start or limit.")

    def drawn(
        self, basis: Basis, x: Array, rest: Array, duration: float, final: bool = True
    ) -> FourierMotion:
        """The motion of x, as near as limits allow on the way from rest; unless `final`, it may still touch
        itself."""
        still = np.zeros_like(x)
        still[:, 0] = rest

        def holds(share: float, every: int) -> bool:
            states = tuple(B[::every] @ (still + share * (x - still)).T for B in basis.fine)
            touches = final and self.bodies is not None and self.bodies.touching(states[0]) is not None
            return self._use(states)[0] <= 1 and not touches

        share = 1.0
        if not holds(1.0, 1):
            low, high = 0.0, 1.0
            for _ in range(14):  # on a few samples, then a little less until all of them hold
                middle = (low + high) / 2
                low, high = (middle, high) if holds(middle, COARSE) else (low, middle)
            share = next((s for s in low * LESS if holds(s, 1)), 0.0)
        return FourierMotion(basis, still + share * (x - still), duration)
