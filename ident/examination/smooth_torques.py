"""Whether a position that looks wrong is one, or a torque of the positions that the model lacks.

A position moves all that its joint carries, in gravity, inertia and friction, so it has to explain more than
any smooth torque of the positions concerned beside the model does: straight lines between knots, products of
them where one position is said to have another in it, each joint's own where two are exchanged. (Of a spring
on an arm's first joint q1 was told as 2 times too large: sin(q / 2) is nearly k q. Of a cable over a UR10e's
wrist q5 was the sum of q5 and q4. Of an LWR4+ all of whose joints move alike the last two torques were told
as exchanged.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, reduce

import numpy as np

from ident.examination.check import listed
from ident.examination.hypothesis import Asked, Hypothesis
from ident.examination.quick import Quick, Sample
from ident.examination.stretches import RARE, Explained, all_rows, half_of, steadily

KNOTS = 8  # bends that a spring's, a counterbalance's or a cable's torque has


class SmoothTorques:
    """Of these joints (places), all together or each of its own position, fitted once and only where
    something is held against them."""

    def __init__(self, asked: Asked, joints: Sequence[int], own: bool = False) -> None:
        self.asked, self.joints, self.own = asked, joints, own

    @cached_property
    def explained(self) -> Explained:
        made = all_rows(self.asked.quick)
        for joints in [[j] for j in self.joints] if self.own else [self.joints]:
            made = with_smooth_torques(made, joints)
        return Explained.by(made, self.asked.how)

    def less_than(self, its: Hypothesis) -> Iterator[Hypothesis]:
        """A hypothesis about the positions of the joints; with the torque that these recordings do not tell
        from it, and not where that explains them steadily better."""
        taken = Explained.by(all_rows(its.quick or self.asked.quick), its.how)
        plain = Explained.by(all_rows(self.asked.quick), self.asked.how)
        if steadily(self.explained, taken, RARE) or not half_of(plain, taken, self.explained):
            yield its
        elif not steadily(taken, self.explained, RARE):
            names = listed(f"q{self.asked.joints[j]}" for j in self.joints)
            between = "there" if self.own or len(self.joints) == 1 else "between them"
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
