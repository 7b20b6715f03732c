"""Whether a position that looks wrong is one, or a torque of the positions that the model lacks.

A position moves all that its joint carries, in gravity, inertia and friction, so it has to explain more than
any smooth torque of the positions concerned beside the model does: straight lines between knots, products of
them of two positions, of more each one's own. (Of a spring on an arm's first joint q1 was told as 2 times too
large: sin(q / 2) is nearly k q. Of a cable over a UR10e's wrist q5 was the sum of q5 and q4. Of an LWR4+ all
of whose joints move alike the last two torques, or the fifth joint and the seventh, were told as exchanged.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, reduce

import numpy as np

from ident.examination.check import listed
from ident.examination.fits.halves import by_halves
from ident.examination.fits.hypothesis import CLEARLY, Asked, Hypothesis
from ident.examination.fits.quick import Fit, Quick
from ident.examination.fits.samples import Sample
from ident.examination.fits.stretches import RARE, Explained, all_rows, half_of, steadily

KNOTS = 8  # bends that a spring's, a counterbalance's or a cable's torque has


class SmoothTorques:
    """Of these joints (places), fitted once and only where something is held against them."""

    def __init__(self, asked: Asked, joints: Sequence[int]) -> None:
        self.asked, self.joints = asked, joints

    @cached_property
    def beside(self) -> Quick:
        made = self.asked.quick
        for joints in [self.joints] if len(self.joints) < 3 else [[j] for j in self.joints]:
            made = with_smooth_torques(made, joints)
        return made

    @cached_property
    def explained(self) -> Explained:
        return Explained.by(all_rows(self.beside), self.asked.how)

    def less_than(self, its: Hypothesis) -> Iterator[Hypothesis]:
        """A hypothesis about the positions of the joints; with the torque that these recordings do not tell
        from it, and not where that explains them steadily better, or foretells clearly better what judges."""
        quick = its.quick or self.asked.quick
        plain = Explained.by(all_rows(self.asked.quick), self.asked.how)
        taken = Explained.less(all_rows(quick), its.how, plain.quick)
        if steadily(self.explained, taken, RARE) or not half_of(plain, taken, self.explained):
            yield its
        elif not (self._explain_more(taken) or self._foretells(quick.fit(its.how))):
            names = listed(f"q{self.asked.joints[j]}" for j in self.joints)
            between = "between them" if len(self.joints) == 2 else "there"
            words = f"the model lacks a torque that goes with {names} (a spring or a cable {between})"
            yield its.beside([replace(its, check=replace(its.check, remedy=""), words=words)])

    def _explain_more(self, taken: Explained) -> bool:
        """Than a motion does, unless of either half they foretell the other clearly worse: they have many
        parameters. (Of a Barrett with its joints exchanged three factors were told instead.)"""
        its = self.explained
        more = steadily(taken, its, RARE)
        return (
            more and max(hold for _, hold in by_halves(taken.quick, taken.how, its.quick, its.how)) > -CLEARLY
        )

    def _foretells(self, other: Fit) -> bool:
        smooth = self.beside.fit(self.asked.how)
        return smooth.validate is not None and smooth.holds_over(other) > CLEARLY


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
