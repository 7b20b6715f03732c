"""A cable or hose that spans two joints: it pulls on both by where both of them are."""

from collections.abc import Iterable, Mapping

import numpy as np

from modelgen.effects.effect import Array, Columns, Effect, LinearParameter
from modelgen.effects.memory import Memory
from modelgen.effects.place import Layout, Model, Motion, Place
from modelgen.effects.truth import Stage, Truth
from modelgen.geometry.robot import Robot


class CableCoupling(Effect):
    """Elastic energy U = k_own q^2/2 + k_cross q q_source + k_source q_source^2/2 about a rest that offsets
    hold:

        joint      tau = k_own q + k_cross q_source           source     tau = k_cross q + k_source q_source

    One k_cross for both: what is elastic is symmetric, a `joint_coupling` through a drive is not. k_own
    alone is a `spring`. Energy is never negative: k_own k_source >= k_cross^2 where all three are known (one
    cable: equal).
    """

    name = "cable_coupling"
    summary = "a cable or hose over two joints pulls on each by the position of the other"
    signature = "a straight line against the other joint's position, the same slope on both joints"
    source = "elastic potential of two coordinates: Goldstein, Classical Mechanics, 2nd ed. 1980, ch. 6"
    agreement = "k_own k_source has to be k_cross^2 at least"
    equation = "tau_joint += k_own q + k_cross q_source, tau_source += k_cross q + k_source q_source"
    remedy = "lay the hose with more slack, or add its three stiffnesses to the model"
    linear = (
        LinearParameter("k_cross", "N m/rad", -500.0, 500.0),
        LinearParameter("k_own", "N m/rad", 0.0, 500.0, "positive", optional=True),
        LinearParameter("k_source", "N m/rad", 0.0, 500.0, "positive", optional=True),
    )
    kind = "load"
    channel = "link"
    joints = "pair"
    sizes = ("k_cross",)
    typical = {"k_cross": 4.0, "k_own": 5.0, "k_source": 5.0}
    common = False

    def places(self, layout: Layout) -> Iterable[Place]:
        """Each pair once."""
        return [p for p in super().places(layout) if p.source is not None and p.source < (p.joint or 0)]

    def variants(self) -> tuple[tuple[str, ...], ...]:
        """A cable without mean tension, and one that holds each joint as well."""
        return (("k_cross",), ("k_cross", "k_own", "k_source"))

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """In the torques of both joints."""
        j, s = place.joint, place.source
        assert j is not None and s is not None
        values = self.pulls(motion.q[:, j], motion.q[:, s])
        use = [self.linear_names.index(name) for name in self.parameters_of(place)]
        return {
            c: values[channel.joint == s][:, use]
            for c, channel in enumerate(model.channels)
            if channel.joint in (j, s) and channel.side != "drive"
        }

    @staticmethod
    def pulls(q: Array, q_source: Array) -> tuple[Array, Array]:
        """(N, 3) torques of the joint, and of the source, per unit of each parameter."""
        zero = np.zeros_like(q)
        return np.stack([q_source, q, zero], axis=1), np.stack([q, zero, q_source], axis=1)

    def stages(self, place: Place) -> tuple[Stage, ...]:
        return ("link_torque",)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        j, s = place.joint, place.source
        assert j is not None and s is not None
        q, k = truth.link[0], np.array([values.get(name, 0.0) for name in self.linear_names])
        added = np.zeros_like(q)
        added[:, j], added[:, s] = (part @ k for part in self.pulls(q[:, j], q[:, s]))
        return truth.with_torque(place, added)

    def beyond(self, values: Mapping[str, float], covariance: Array, place: Place, robot: Robot) -> float:
        """An elastic body stores energy whichever way it is stretched: k_own k_source >= k_cross^2. Of one
        cable, which is stretched by one combination of its joints, both are equal: noise alone puts half of
        these beyond. (Of an arm with one that MuJoCo moved no cable was told, and a position in doubt.)"""
        names = self.parameters_of(place)
        if not set(values) >= set(self.linear_names):
            return 0.0
        cross, own, source = (values[name] for name in self.linear_names)
        slope = dict(zip(self.linear_names, (-2.0 * cross, source, own)))
        over = np.array([slope[name] for name in names])
        deviation = float(np.sqrt(max(over @ covariance @ over, 1e-300)))
        return max(0.0, (cross**2 - own * source) / deviation)


EFFECT = CableCoupling()
