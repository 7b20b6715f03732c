"""Positions in another unit than rad: all of them in degrees, one times a number, one of a motor's turns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.hypothesis import CLEARLY, Asked, Hypothesis, falls
from ident.examination.quick import Fit, Quick
from ident.examination.signals import TURNS
from ident.examination.smooth_torques import SmoothTorques
from ident.examination.stretches import RARE, Explained, all_rows, steadily

POSITION_FACTORS = (0.1, 0.5, 2.0, 2 * np.pi, 10.0, 180 / np.pi)  # turns are 2 pi
DEGREES, HALF = np.pi / 180, 0.5
NEXT, LEAST = 1.18, 0.1  # of factors of a position: the next one, and rad that it leaves at least
FINE, NORMAL = 1.01, 1.96  # steps of what a factor may be, and standard deviations of that to either side


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


def geared(asked: Asked) -> Iterator[Hypothesis]:
    """One position that goes beyond two turns, by the factor with which the torques are explained best, of
    either sign: the motor's side of a gear, or another unit. (Of an LWR4+ whose second position was 101 times
    too large it was told as exchanged with the fifth one, whose motion is the same.)"""
    for j, (label, reach) in enumerate(zip(asked.joints, reach_of(asked))):
        if label not in asked.quick.columns.model.prismatic and reach > TURNS:
            yield from _geared(asked, np.arange(len(asked.joints)) == j, f"q{label}", reach)


def _geared(asked: Asked, its: np.ndarray, name: str, reach: float) -> Iterator[Hypothesis]:
    def taken(factor: float) -> Quick:
        return asked.quick.moved(factor=np.where(its, factor, 1.0))

    def explained(factor: float) -> Explained:
        return Explained.by(all_rows(taken(factor)), asked.how)

    gains = {f: taken(f).fit(asked.how).gain_over(asked.fit) for f in _ratios(reach)}
    for step in (NEXT ** (1 / 3), NEXT ** (1 / 9), NEXT ** (1 / 27)):
        at = max(gains, key=lambda f: gains[f])
        gains |= {f: taken(f).fit(asked.how).gain_over(asked.fit) for f in (at / step, at * step)}
    best = max(gains, key=lambda f: gains[f])
    one = explained(best)
    if not steadily(explained(DEGREES), one, RARE):  # which `degrees` tells
        return
    ends = []  # factors that stretch by stretch are not rejected beside the best one
    for step in (1 / FINE, FINE):
        factor = best
        while abs(np.log(factor / best)) < 3 * np.log(NEXT) and not steadily(
            explained(factor * step), one, RARE
        ):
            factor *= step
        ends.append(abs(factor))
    sign = " and has the other sign" if best < 0 else ""
    said = f"{name} is {1 / abs(best):.3g} times too large ({1 / ends[1]:.3g} to {1 / ends[0]:.3g}){sign}"
    change = {"scale": float(f"{abs(best):.4g}")} | ({"sign": -1} if best < 0 else {})

    def told(other: Fit) -> Check:
        return Check(
            "angle_unit",
            (name,),
            f"{said}: the motor's side of the gear, or another unit; so taken, {falls(asked.fit, other)}",
            asked.line({name: change}),
            spread=(ends[1] - ends[0]) / (2 * NORMAL * abs(best)),
        )

    yield from asked.along(taken(best), told, said)


def reach_of(asked: Asked) -> np.ndarray:
    """(n,) rad, the farthest that every joint goes."""
    return np.max([np.abs(s.q).max(axis=0) for s in asked.quick.samples], axis=0)


def _ratios(reach: float) -> list[float]:
    """Factors that leave a joint a turn at most and a tenth of a radian at least, of both signs, so close
    that no angle differs by more than a radian between two of them."""
    count = int(np.ceil(np.log(2 * np.pi / LEAST) / np.log(NEXT)))
    factors = 2 * np.pi / reach * NEXT ** -np.arange(count + 1.0)
    return [float(sign * f) for f in factors for sign in (1, -1)]


def degrees(asked: Asked) -> Iterator[Hypothesis]:
    """All positions in degrees, or those of the joints that go beyond two turns; all in turns."""
    quick, fit = asked.quick, asked.fit
    turning = np.array([joint not in quick.columns.model.prismatic for joint in asked.joints])
    reach = reach_of(asked)
    if reach[turning].max(initial=0.0) < 2 * np.pi:
        names = [f"q{j}" for j, turns in zip(asked.joints, turning) if turns]
        line = asked.line({name: {"scale": 6.28319} for name in names})
        moved = quick.moved(factor=np.where(turning, 2 * np.pi, 1.0))
        words = "the positions are in turns"

        def in_turns(other: Fit) -> Check:
            return Check("angle_unit", tuple(names), f"{words}: taken so, {falls(fit, other)}", line)

        if len(names) > 1 and reach[turning].max() < 2.0:
            yield from asked.along(moved, in_turns, words)
        return
    far = turning & (reach > TURNS)
    for which in (turning, far) if far.any() and (far != turning).any() else (turning,):
        names = [f"q{j}" for j, turns in zip(asked.joints, which) if turns]
        subject = "the positions" if which is turning else listed(names)
        gear = "" if len(names) > 1 else ", or the motor's side of a gear of about that ratio"

        def told(other: Fit, names: list = names, subject: str = subject, gear: str = gear) -> Check:
            verb = "are" if len(names) > 1 else "is"
            return Check(
                "angle_unit",
                tuple(names),
                f"{subject} {verb} in degrees{gear}: taken so, {falls(fit, other)}",
                "write " + asked.line({name: {"scale": 0.0174533} for name in names}),
                outcome="refused",
            )

        moved = quick.moved(factor=np.where(which, DEGREES, 1.0))
        after = moved.fit(asked.how)
        halved = after.gain_over(fit) > -np.log(HALF) * np.isfinite(fit.error).sum()
        if halved and np.nanmedian(after.error) < HALF * np.nanmedian(fit.error):
            yield from asked.along(moved, told, least=CLEARLY)
