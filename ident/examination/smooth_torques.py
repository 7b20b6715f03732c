"""Whether a position that looks wrong is one, or a torque of the positions that the model lacks.

A position moves all that its joint carries, in gravity, inertia and friction, so it has to explain more than
any smooth torque of the positions concerned beside the model does: straight lines between knots, products of
them where there are two. (Of a spring on an arm's first joint q1 was told as 2 times too large: sin(q / 2) is
nearly k q. Of a cable over a UR10e's wrist q5 was the sum of q5 and q4.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, reduce

import numpy as np

from ident.examination.check import listed
from ident.examination.hypothesis import Asked, Hypothesis
from ident.examination.quick import Quick, Sample
from ident.examination.stretches import RARE, Explained, all_rows, steadily

KNOTS = 8  # bends that a spring's, a counterbalance's or a cable's torque has


class SmoothTorques:
    """Of these joints (places), fitted once and only where something is held against them."""

    def __init__(self, asked: Asked, joints: Sequence[int]) -> None:
        self.asked, self.joints = asked, joints

    @cached_property
    def explained(self) -> Explained:
        whole = all_rows(self.asked.quick)
        return Explained.by(with_smooth_torques(whole, self.joints), self.asked.how)

    def less_than(self, its: Hypothesis) -> Iterator[Hypothesis]:
        """A hypothesis about the positions of the joints; with the torque that these recordings do not tell
        from it, and not where that explains them steadily better."""
        taken = Explained.by(all_rows(its.quick or self.asked.quick), its.how)
        if steadily(self.explained, taken, RARE):
            yield its
        elif not steadily(taken, self.explained, RARE):
            names = listed(f"q{self.asked.joints[j]}" for j in self.joints)
            between = "between them" if len(self.joints) > 1 else "there"
            words = f"the model lacks a torque that goes with {names} (a spring or a cable {between})"
            yield its.beside([replace(its, check=replace(its.check, remedy=""), words=words)])


def with_smooth_torques(quick: Quick, joints: Sequence[int]) -> Quick:
    """The same where the torques of these joints have, each, any function of their positions beside."""
    every = np.concatenate([s.q for s in quick.samples])[:, list(joints)]
    knots = [np.linspace(low, high, KNOTS) for low, high in zip(every.min(axis=0), every.max(axis=0))]
    own = [np.array(quick.columns.joint_of, int)[:, None, None] == j for j in joints]

    def beside(s: Sample) -> Sample:
        each = [
            np.stack([np.interp(s.q[:, j], at, h) for h in np.eye(KNOTS)], 1) for j, at in zip(joints, knots)
        ]
        hats = reduce(lambda a, b: (a[:, :, None] * b[:, None, :]).reshape(len(a), -1), each)
        return s.beside(np.concatenate([its * hats for its in own], axis=2))

    return quick.of([beside(s) for s in quick.samples])
