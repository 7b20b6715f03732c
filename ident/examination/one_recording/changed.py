"""What is different in one recording; and what may be, in the place of that, in all of them.

Of a fault in all recordings the fitted ones may be too poor to tell, so that it shows in those that judge
alone: what has no number is here (a sign, a place, degrees), what has one is among the rivals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any

import numpy as np

from ident.examination.fits.hypothesis import SWAPPED, Asked
from ident.examination.fits.quick import Quick
from ident.examination.fits.stretches import Explained
from ident.examination.positions.places import exchanged
from ident.examination.positions.units import DEGREES, Factor, ratios, reach_of, so_many_times, times_too
from ident.examination.tables.signals import TURNS
from ident.examination.torques.magnitudes import UNSIGNED, remedy, signed
from ident.examination.torques.signs import several_signs


@dataclass(frozen=True, slots=True)
class Changed:
    """What is different in one recording, or without one in all, in words, what to do and what is then
    explained; no `signals` and no `check` where it is none of its signals."""

    recording: str
    signals: tuple[str, ...]
    check: str
    words: str
    remedy: str
    explained: Explained
    least: float = SWAPPED
    drives: tuple[int, ...] = ()
    factor: float | None = None  # that its torques are multiplied by


def torques_in_all(asked: Asked, whole: Quick) -> Iterator[Changed]:
    """A torque turned, or several, or one without its sign, two of a side exchanged."""
    yield from unsigned(asked, whole, [""])
    for its in several_signs(replace(asked, quick=whole, fit=whole.fit(asked.how))):
        explained, said = Explained.by(whole, its.how), its.check
        yield Changed("", said.signals, said.check, its.words, said.remedy, explained)
    how, channels = asked.how, whole.columns.need.channels
    for c in asked.seen:
        name, explained = asked.name(c), Explained.by(whole, how.times([c], -1.0))
        line = asked.line({name: {"sign": -1}})
        yield Changed("", (name,), "torque_sign", f"{name} has the other sign", line, explained)
    for a, b in combinations(asked.seen, 2):
        if channels[a].side == channels[b].side:
            placed = how.placed(exchanged(len(channels), a, b), asked.gains)
            yield _exchanged(asked, asked.name(a), asked.name(b), Explained.by(whole, placed))


def unsigned(asked: Asked, whole: Quick, labels: Sequence[str]) -> Iterator[Changed]:
    """A torque of one of these recordings without its sign, "" of all."""
    for c, label in product(asked.seen, labels):
        taken = signed(asked, whole, c, label)
        if taken is not None:
            name, explained = asked.name(c), Explained.by(taken, asked.how)
            words = f"{name} {UNSIGNED}"
            yield Changed(label, (name,), "unsigned_torque", words, remedy(asked, c), explained)


def positions_in_all(asked: Asked, whole: Quick) -> Iterator[Changed]:
    """A position turned, or in degrees or before a gear where it goes beyond two turns; two exchanged."""
    n, reach, prismatic = len(asked.joints), reach_of(asked), whole.columns.model.prismatic
    for j, joint in enumerate(asked.joints):
        name, its = f"q{joint}", np.arange(n) == j
        turned = "has the other sign (or its axis in the robot file)"
        ways = [("position_sign", turned, {"sign": -1}, -1.0)]
        if joint not in prismatic and reach[j] > TURNS:
            ways.append(_before_a_gear(replace(asked, quick=whole, fit=whole.fit(asked.how)), its, reach[j]))
        for check, words, change, factor in ways:
            explained = Explained.by(whole.moved(factor=np.where(its, factor, 1.0)), asked.how)
            yield Changed("", (name,), check, f"{name} {words}", asked.line({name: change}), explained)
    for a, b in combinations(range(n), 2):
        moved = Explained.by(whole.moved(exchanged(n, a, b)), asked.how)
        yield _exchanged(asked, f"q{asked.joints[a]}", f"q{asked.joints[b]}", moved)


def _before_a_gear(asked: Asked, its: np.ndarray, reach: float) -> tuple[str, str, dict[str, Any], float]:
    """Check, words, change and factor, of either sign, of a position that goes beyond two turns. (Of a
    rokae's first one times 100 degrees were told; of an AIRBOT's in degrees with the other sign 59.8 times
    or more.)"""
    (factor,) = Factor.each(asked, its, [sign * f for f in ratios(reach) for sign in (1, -1)])
    if factor.allows(DEGREES):
        words = "is in degrees, or before a gear of about that ratio"
        return "angle_unit", words, {"scale": DEGREES}, DEGREES
    known, sign = so_many_times(*factor.ends()), " and has the other sign" if factor.best < 0 else ""
    size = abs(factor.best)
    words = f"is {times_too(1 / size)} ({known}){sign}, by the motor's side of the gear or another unit"
    change = {"scale": float(f"{size:.4g}")} | ({"sign": -1} if sign else {})
    return "angle_unit", words, change, factor.best


def _exchanged(asked: Asked, one: str, other: str, explained: Explained) -> Changed:
    words, line = f"{one} and {other} look swapped", asked.line({one: {"of": other}, other: {"of": one}})
    return Changed("", (one, other), "swapped_signals", words, line, explained)
