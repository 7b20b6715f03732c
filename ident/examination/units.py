"""Positions in another unit than rad: all of them in degrees, or one times a number."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.hypothesis import CLEARLY, Asked, Hypothesis, falls
from ident.examination.quick import Fit, Sample
from ident.examination.signals import TURNS

POSITION_FACTORS = (0.1, 0.5, 2.0, 10.0, 180 / np.pi)
DEGREES, HALF = np.pi / 180, 0.5
KNOTS = 8  # of a torque of one position: bends that a spring's, a counterbalance's or a cable's has


def scaled_positions(asked: Asked) -> Iterator[Hypothesis]:
    """One position times a number: another unit, a gear counted twice or not at all. It moves all that the
    joint carries, so it has to explain more than any torque of that position alone beside the model does. (Of
    a spring on an arm's first joint q1 was told as 2 times too large: sin(q / 2) is nearly k q.)"""
    for j, label in enumerate(asked.joints):
        itself: Fit | None = None
        for factor in POSITION_FACTORS:

            def told(other: Fit, label: str = label, factor: float = factor) -> Check:
                return Check(
                    "angle_unit",
                    (f"q{label}",),
                    f"q{label} looks {1 / factor:.3g} times too large: another unit, or a gear that is "
                    f"counted twice or not at all; so taken, {falls(asked.fit, other)}",
                    asked.line({f"q{label}": {"scale": factor}}),
                )

            moved = asked.quick.moved(factor=np.where(np.arange(len(asked.joints)) == j, factor, 1.0))
            for its in asked.along(moved, told, f"q{label} is {1 / factor:.3g} times too large"):
                itself = itself or _of_itself(asked, j)
                if its.gain > itself.gain_over(asked.fit):
                    yield its


def _of_itself(asked: Asked, j: int) -> Fit:
    """The fit where a joint's torques have any function of its own position beside the model: straight lines
    between knots."""
    quick = asked.quick
    every = np.concatenate([s.q[:, j] for s in quick.samples])
    knots = np.linspace(every.min(), every.max(), KNOTS)

    def beside(s: Sample) -> Sample:
        hats = np.stack([np.interp(s.q[:, j], knots, hat) for hat in np.eye(KNOTS)], axis=1)
        own = np.array(quick.columns.joint_of, int)[:, None, None] == j
        return s.beside(own * hats)

    return quick.of([beside(s) for s in quick.samples]).fit(asked.how)


def degrees(asked: Asked) -> Iterator[Hypothesis]:
    """All positions in degrees, or those of the joints that go beyond two turns."""
    quick, fit = asked.quick, asked.fit
    turning = np.array([joint not in quick.columns.model.prismatic for joint in asked.joints])
    reach = np.max([np.abs(s.q).max(axis=0) for s in quick.samples], axis=0)
    if reach[turning].max(initial=0.0) < 2 * np.pi:
        return
    far = turning & (reach > TURNS)
    for which in (turning, far) if far.any() and (far != turning).any() else (turning,):
        names = [f"q{j}" for j, turns in zip(asked.joints, which) if turns]
        subject = "the positions" if which is turning else listed(names)

        def told(other: Fit, names: list = names, subject: str = subject) -> Check:
            return Check(
                "angle_unit",
                tuple(names),
                f"{subject} {'are' if len(names) > 1 else 'is'} in degrees: taken so, {falls(fit, other)}",
                "write " + asked.line({name: {"scale": 0.0174533} for name in names}),
                outcome="refused",
            )

        moved = quick.moved(factor=np.where(which, DEGREES, 1.0))
        after = moved.fit(asked.how)
        halved = after.gain_over(fit) > -np.log(HALF) * np.isfinite(fit.error).sum()
        if halved and np.nanmedian(after.error) < HALF * np.nanmedian(fit.error):
            yield from asked.along(moved, told, least=CLEARLY)
