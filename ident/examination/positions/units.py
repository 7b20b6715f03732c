"""Positions in another unit than rad: all of them in one, one times a number, one of a motor's turns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.hypothesis import CLEARLY, SWAPPED, Asked, Hypothesis, falls
from ident.examination.fits.quick import Fit, Quick
from ident.examination.fits.stretches import RARE, Explained, all_rows, steadily
from ident.examination.tables.signals import TURNS
from ident.examination.torques.smooth_torques import SmoothTorques

POSITION_FACTORS = (0.1, 0.5, 2.0, 2 * np.pi, 10.0, 180 / np.pi)  # turns are 2 pi
DEGREES, HALF = np.pi / 180, 0.5
UNITS = {"degrees": DEGREES, "gon": np.pi / 200}  # the usual one first
NEXT, LEAST = 1.18, 0.1  # of factors of a position: the next one, and rad that it leaves at least
FINE, NORMAL = 1.01, 1.96  # steps of what a factor may be, and standard deviations of that to either side
MOST = round(np.log(2 * np.pi / LEAST) / np.log(FINE))  # of these steps: the range that is asked
DOUBLE = (*(2**k for k in range(9)), MOST)


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

            moved = taken(asked, np.arange(len(asked.joints)) == j, factor)
            for its in asked.along(moved, told, f"q{label} is {times_too(1 / factor)}"):
                yield from smooth.less_than(its)


def geared(asked: Asked) -> Iterator[Hypothesis]:
    """One position that goes beyond two turns, by the factor with which the torques are explained best, of
    either sign: the motor's side of a gear, or another unit. (Of an LWR4+ whose second position was 101 times
    too large it was told as exchanged with the fifth one, whose motion is the same.)"""
    for j, (label, reach) in enumerate(zip(asked.joints, reach_of(asked))):
        if label not in asked.quick.columns.model.prismatic and reach > TURNS:
            yield from _geared(asked, np.arange(len(asked.joints)) == j, f"q{label}", reach)


@dataclass(frozen=True, slots=True)
class Factor:
    """What positions `its` (n,) bool are to be multiplied by, and torques `own` divided by: the best number,
    and what it explains."""

    asked: Asked
    its: np.ndarray
    own: tuple[int, ...]
    best: float
    explained: Explained

    @classmethod
    def each(
        cls, asked: Asked, its: np.ndarray, factors: Iterable[float], owns: Sequence[tuple[int, ...]] = ((),)
    ) -> list[Factor]:
        """The best of some, and between its neighbours; with each of these torques."""

        def gains(factor: float) -> list[float]:
            hows = [asked.how.times(own, 1 / factor) for own in owns]
            return [fit.gain_over(asked.fit) for fit in taken(asked, its, factor).fits(hows)]

        known, out = {f: gains(f) for f in factors}, []
        for k, own in enumerate(owns):
            for step in (NEXT ** (1 / 3), NEXT ** (1 / 9), NEXT ** (1 / 27)):
                at = max(known, key=lambda f: known[f][k])
                known |= {f: gains(f) for f in (at / step, at * step)}
            best = max(known, key=lambda f: known[f][k])
            out.append(cls(asked, its, own, best, _explained(asked, its, best, own)))
        return out

    def ends(self) -> tuple[float, float]:
        """The least and the largest by size that stretch by stretch are not rejected beside the best one, by
        steps that double, then halve, down to FINE; 0 and infinity where there is none. (Of an AIRBOT's first
        position, times 121, they ended at 113: nothing but what the joint's turns do to others tells it.)"""
        each = []
        for step, none in ((1 / FINE, 0.0), (FINE, np.inf)):
            beyond = next((n for n in DOUBLE if not self.allows(self.best * step**n)), None)
            kept = max(n for n in (0, *DOUBLE) if beyond is None or n < beyond)
            while beyond is not None and beyond - kept > 1:
                middle = (kept + beyond) // 2
                kept, beyond = (middle, beyond) if self.allows(self.best * step**middle) else (kept, middle)
            each.append(none if beyond is None else abs(self.best * step**kept))
        return each[0], each[1]

    def allows(self, factor: float) -> bool:
        """Whether it is not rejected beside the best one."""
        its = _explained(self.asked, self.its, factor, self.own)
        return not steadily(its, self.explained, RARE)

    @property
    def unit(self) -> str:
        """The first that is allowed beside the best number, or the one that explains hardly less, or none."""
        told = next((name for name, size in UNITS.items() if self.allows(size)), "")
        if told:
            return told
        each = [(name, _explained(self.asked, self.its, size, ()).fit) for name, size in UNITS.items()]
        behind, nearest = min((self.explained.fit.gain_over(fit), name) for name, fit in each)
        return nearest if behind < CLEARLY else ""


def so_many_times(low: float, high: float) -> str:
    """How many times too large positions are by factors that `Factor.ends` gives."""
    if low and np.isfinite(high):
        return f"{1 / high:.3g} to {1 / low:.3g}"
    return f"up to {1 / low:.3g}" if low else f"{1 / high:.3g} or more"


def taken(asked: Asked, its: np.ndarray, factor: float) -> Quick:
    """The recordings with positions `its` (n,) bool times a factor."""
    return asked.quick.moved(factor=np.where(its, factor, 1.0))


def _explained(asked: Asked, its: np.ndarray, factor: float, own: Sequence[int]) -> Explained:
    return Explained.by(all_rows(taken(asked, its, factor)), asked.how.times(own, 1 / factor))


def _geared(asked: Asked, its: np.ndarray, name: str, reach: float) -> Iterator[Hypothesis]:
    """The position alone, or with its torque, which a gear makes smaller by what it makes the position
    larger. (Of an LWR4+'s second joint on the motor's side of a gear of 100, the position was told to be 258
    times too large with the other sign, and the fourth torque 347 times.)"""
    own = tuple(np.flatnonzero(its[np.array(asked.quick.columns.joint_of, int)]).tolist())
    tried = [sign * f for f in ratios(reach) for sign in (1, -1)]
    alone, factor = Factor.each(asked, its, tried, ((), own))
    if not steadily(alone.explained, factor.explained, RARE):
        factor = alone
    if factor.allows(DEGREES) and not factor.own:  # which `degrees` tells
        return
    best, how = factor.best, asked.how.times(factor.own, 1 / factor.best)
    moved = taken(asked, its, best)
    if not asked.better(moved.fit(how), SWAPPED):
        return
    low, high = factor.ends()
    known = so_many_times(low, high)
    torques = asked.names(factor.own)
    small = f" and {listed(torques)} as many times too small" if torques else ""
    sign = " and has the other sign" if best < 0 else ""
    said = f"{name} is {1 / abs(best):.3g} times too large ({known}){sign}{small}"
    turned = {"sign": -1} if best < 0 else {}
    changes = {name: {"scale": float(f"{abs(best):.4g}")} | turned}
    changes |= {torque: {"scale": float(f"{1 / abs(best):.4g}")} | turned for torque in torques}
    why = "the motor's side of the gear" + ("" if torques else ", or another unit")

    def told(other: Fit) -> Check:
        return Check(
            "angle_unit",
            (name, *torques),
            f"{said}: {why}; so taken, {falls(asked.fit, other)}",
            f"{asked.line(changes)}  # {known} times too large by these torques",
            spread=(high - low) / (2 * NORMAL * abs(best)),
        )

    yield from asked.along(moved, told, said, how)


def reach_of(asked: Asked) -> np.ndarray:
    """(n,) rad, the farthest that every joint goes."""
    return np.max([np.abs(s.q).max(axis=0) for s in asked.quick.samples], axis=0)


def ratios(reach: float) -> list[float]:
    """Factors that leave a joint a turn at most and a tenth of a radian at least, so close that no angle
    differs by more than a radian between two of them."""
    count = int(np.ceil(np.log(2 * np.pi / LEAST) / np.log(NEXT)))
    return [float(f) for f in 2 * np.pi / reach * NEXT ** -np.arange(count + 1.0)]


def degrees(asked: Asked) -> Iterator[Hypothesis]:
    """All positions in degrees or another unit, or those that go beyond two turns; all in turns. Degrees are
    told where these torques allow them beside the number that explains most. (Of six arms whose positions
    were in gon they were told for that.)"""
    quick, fit = asked.quick, asked.fit
    turning = np.array([joint not in quick.columns.model.prismatic for joint in asked.joints])
    reach = reach_of(asked)
    if reach[turning].max(initial=0.0) < 2 * np.pi:
        names = [f"q{j}" for j, turns in zip(asked.joints, turning) if turns]
        line = asked.line({name: {"scale": 6.28319} for name in names})
        words = "the positions are in turns"

        def in_turns(other: Fit) -> Check:
            return Check("angle_unit", tuple(names), f"{words}: taken so, {falls(fit, other)}", line)

        if len(names) > 1 and reach[turning].max() < 2.0:
            yield from asked.along(taken(asked, turning, 2 * np.pi), in_turns, words)
        return
    far = turning & (reach > TURNS)
    (every,) = Factor.each(asked, turning, ratios(reach[turning].max()))
    if not far.any() or (far == turning).all():
        yield from _of_one_unit(every, "the positions")
        return
    (some,) = Factor.each(asked, far, ratios(reach[far].max()))
    yield from _of_one_unit(some)
    if steadily(some.explained, every.explained, RARE):  # or the others, which hardly move then, are right
        yield from _of_one_unit(every, "the positions")


def _of_one_unit(factor: Factor, subject: str = "") -> Iterator[Hypothesis]:
    asked, which, fit = factor.asked, factor.its, factor.asked.fit
    names = [f"q{j}" for j, turns in zip(asked.joints, which) if turns]
    unit = factor.unit
    scale = UNITS.get(unit, float(f"{factor.best:.3g}"))
    if len(names) == 1 and scale != DEGREES:  # which `geared` tells
        return
    after = taken(asked, which, scale).fit(asked.how)
    halved = after.gain_over(fit) > -np.log(HALF) * np.isfinite(fit.error).sum()
    halved = bool(halved and np.nanmedian(after.error) < HALF * np.nanmedian(fit.error))
    if len(names) > 1 and not halved:  # one is told as any other fault of a position
        return
    (low, high), each = factor.ends(), ""
    known = so_many_times(low, high)
    if unit:
        gear = "" if len(names) > 1 else ", or the motor's side of a gear of about that ratio"
        said = f"in {unit}{gear} ({1 / scale:.3g} to a rad, {known} by these torques)"
    else:  # of gears of 51 to 101 as one number explained as much as one for each
        said = (
            f"{1 / scale:.3g} times too large (where it is one number for all, {known}), in a unit that is "
            "not told, or each times the ratio of its own gear, as its motor counts"
        )
        each = "  # or each by its own gear's ratio, where motors are what is recorded"

    said = f"{subject or listed(names)} {'are' if len(names) > 1 else 'is'} {said}"
    line = asked.line({name: {"scale": float(f"{scale:.6g}")} for name in names})

    def told(other: Fit) -> Check:
        message = f"{said}: taken so, {falls(fit, other)}"
        if halved:
            return Check("angle_unit", tuple(names), message, f"write {line}{each}", outcome="refused")
        spread = (high - low) / (2 * NORMAL * scale)
        return Check("angle_unit", tuple(names), message, line, spread=spread)

    least = (SWAPPED, CLEARLY)[halved]
    yield from asked.along(taken(asked, which, scale), told, "" if halved else said, least=least)
