"""Positions in another unit than rad: all of them in degrees, or one times a number."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.hypothesis import CLEARLY, Asked, Hypothesis, falls
from ident.examination.quick import Fit
from ident.examination.signals import TURNS
from ident.examination.smooth_torques import SmoothTorques

POSITION_FACTORS = (0.1, 0.5, 2.0, 10.0, 180 / np.pi)
DEGREES, HALF = np.pi / 180, 0.5


def times_too(factor: float) -> str:
    """Of what is a number times what it should be."""
    return f"{max(factor, 1 / factor):.3g} times too {'large' if factor > 1 else 'small'}"


def scaled_positions(asked: Asked) -> Iterator[Hypothesis]:
    """One position times a number: another unit, a gear counted twice or not at all."""
    for j, label in enumerate(asked.joints):
        smooth = SmoothTorques(asked, [j])
        for factor in POSITION_FACTORS:

            def told(other: Fit, label: str = label, factor: float = factor) -> Check:
                return Check(
                    "angle_unit",
                    (f"q{label}",),
                    f"q{label} looks {times_too(1 / factor)}: another unit, or a gear that is "
                    f"counted twice or not at all; so taken, {falls(asked.fit, other)}",
                    asked.line({f"q{label}": {"scale": factor}}),
                )

            moved = asked.quick.moved(factor=np.where(np.arange(len(asked.joints)) == j, factor, 1.0))
            for its in asked.along(moved, told, f"q{label} is {times_too(1 / factor)}"):
                yield from smooth.less_than(its)


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
