"""Positions in another unit than rad: all of them in degrees, or one times a number."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ident.examination.check import Check, column_line, listed
from ident.examination.hypothesis import CLEARLY, Hypothesis, falls
from ident.examination.places import SWAPPED
from ident.examination.quick import Assignment, Fit, Quick
from ident.examination.signals import TURNS

POSITION_FACTORS = (0.1, 0.5, 2.0, 10.0, 180 / np.pi)
DEGREES, HALF = np.pi / 180, 0.5


def scaled_positions(quick: Quick, fit: Fit, how: Assignment, maps: dict) -> Iterator[Hypothesis]:
    """One position times a number: another unit, a gear counted twice or not at all."""
    columns = quick.columns
    for j, label in enumerate(columns.need.joints):
        for factor in POSITION_FACTORS:
            times = np.where(np.arange(len(columns.need.joints)) == j, factor, 1.0)
            samples = [
                s.moved(columns, s.q * times, s.dq * times, s.ddq * times, s.sign) for s in quick.samples
            ]
            moved = quick.of(samples)
            other = moved.fit(how)
            if not (other.gain_over(fit) > SWAPPED and other.holds_over(fit) > 0.5 * SWAPPED):
                continue
            check = Check(
                "angle_unit",
                (f"q{label}",),
                f"q{label} looks {1 / factor:.3g} times too large: another unit, or a gear that is counted "
                f"twice or not at all; so taken, {falls(fit, other)}",
                column_line(maps, {f"q{label}": {"scale": factor}}),
            )
            words = f"q{label} is {1 / factor:.3g} times too large"
            yield Hypothesis(other.gain_over(fit), how, check, moved, words)


def degrees(quick: Quick, fit: Fit, how: Assignment, maps: dict[str, Any]) -> Iterator[Hypothesis]:
    """All positions in degrees, or those of the joints that go beyond two turns."""
    columns = quick.columns
    turning = np.array([str(j) not in columns.model.prismatic for j in columns.need.joints])
    reach = np.max([np.abs(s.q).max(axis=0) for s in quick.samples], axis=0)
    if reach[turning].max(initial=0.0) < 2 * np.pi:
        return
    far = turning & (reach > TURNS)
    for which in (turning, far) if far.any() and (far != turning).any() else (turning,):
        factor = np.where(which, DEGREES, 1.0)
        moved = quick.of(
            [s.moved(columns, s.q * factor, s.dq * factor, s.ddq * factor, s.sign) for s in quick.samples]
        )
        other = moved.fit(how)
        enough = other.gain_over(fit) > CLEARLY and other.holds_over(fit) > 0.5 * CLEARLY
        fallen = (np.nanmedian(other.error) / np.nanmedian(fit.error) < HALF) and (
            np.nanmax(other.error) / np.nanmax(fit.error) < HALF
        )
        if enough and fallen:
            names = [f"q{j}" for j, turns in zip(columns.need.joints, which) if turns]
            check = Check(
                "angle_unit",
                tuple(names),
                f"{'the positions' if which is turning else listed(names)} "
                f"{'are' if len(names) > 1 else 'is'} in degrees: taken so, the errors of the torques fall "
                f"from {100 * np.nanmax(fit.error):.0f} to {100 * np.nanmax(other.error):.0f} % at most",
                "write " + column_line(maps, {name: {"scale": 0.0174533} for name in names}),
                outcome="refused",
            )
            yield Hypothesis(other.gain_over(fit), how, check, moved)
