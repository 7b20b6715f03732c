"""One joint's torque or its position with the other sign, and whether the recordings tell which.

A joint whose position is turned is its mirror image with the torque turned: its own friction and gravity fit
either. What it shares with other joints tells them apart, stretch by stretch; where that is too little both
are named.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ident.examination.check import Check, column_line, turned_sign
from ident.examination.hypothesis import CLEARLY, Hypothesis, falls, signal_of
from ident.examination.places import SWAPPED
from ident.examination.quick import Assignment, Fit, Quick
from ident.examination.signs import Evidence, evidence
from ident.examination.stretches import RARE, Explained, all_rows, steadily

WORSE = 0.05  # loss at which a sign is not asked further


def one_turned(quick: Quick, fit: Fit, how: Assignment, maps: dict, currents: bool) -> Iterator[Hypothesis]:
    """One torque with the other sign, or its joint's position where that explains as much or more."""
    seen: Evidence | None = None
    for c in np.flatnonzero(quick.identify.rows > 10).tolist():
        flipped = how.times([c], -1.0)
        other = quick.fit(flipped)
        gain, holds = other.gain_over(fit), other.holds_over(fit)
        if gain < -WORSE:
            continue
        seen = seen or evidence(quick, fit, how)
        after = evidence(quick, other, flipped)
        contradicts = gain > CLEARLY and holds > 0.5 * CLEARLY and not after.against(c)
        alone = seen.against(c) and after.speaks_for(c)
        if not contradicts and not alone:
            continue
        name, joint = signal_of(quick.columns, c, currents), quick.columns.channels[c][5:]
        why = (
            f"friction or inertia of joint {joint} comes out negative"
            if seen.against(c)
            else f"turned, the error of joint {joint}'s torque falls from "
            f"{100 * fit.error[c]:.0f} to {100 * other.error[c]:.0f} %"
        )
        its = Hypothesis(
            gain + (1.0 if alone else 0.0),
            flipped,
            turned_sign((name,), f"{name} has the other sign: {why}", maps),
            words=f"{name} has the other sign",
            own=alone,
        )
        yield _which(quick, fit, how, c, its, maps)


def _which(quick: Quick, fit: Fit, how: Assignment, c: int, torque: Hypothesis, maps: dict) -> Hypothesis:
    """A torque turned, its joint's position in its place, or the torque with the position named beside it."""
    position = turned_position(quick, fit, how, int(quick.columns.joint_of[c]), maps, torque.own)
    assert position.quick is not None
    one, other = (
        Explained(whole, whole.fit(its), its)
        for whole, its in ((all_rows(quick), torque.how), (all_rows(position.quick), how))
    )
    if steadily(other, one, RARE):
        return torque
    return position if steadily(one, other, RARE) else torque.beside([position])


def turned_positions(quick: Quick, fit: Fit, how: Assignment, maps: dict) -> Iterator[Hypothesis]:
    """One position with the other sign, by what all torques say of it."""
    for j in range(len(quick.columns.need.joints)):
        its = turned_position(quick, fit, how, j, maps)
        assert its.quick is not None
        if its.gain > SWAPPED and its.quick.fit(how).holds_over(fit) > 0.5 * SWAPPED:
            yield its


def turned_position(
    quick: Quick, fit: Fit, how: Assignment, j: int, maps: dict, own: bool = False
) -> Hypothesis:
    """The position of a joint, by its place among them, with the other sign. own: its friction says so."""
    label, sign = str(quick.columns.need.joints[j]), np.ones(len(quick.columns.need.joints))
    sign[j] = -1.0
    turned = quick.of([s.moved(quick.columns, *(x * sign for x in s.motion)) for s in quick.samples])
    other = turned.fit(how)
    check = Check(
        "position_sign",
        (f"q{label}",),
        f"the position of joint {label} looks recorded with the other sign, or its axis in the robot file "
        f"points the other way: turned, {falls(fit, other)}",
        column_line(maps, {f"q{label}": {"sign": -1}}),
    )
    gain = other.gain_over(fit) + (1.0 if own else 0.0)
    words = f"q{label} has the other sign (or its axis in the robot file)"
    return Hypothesis(gain, how, check, turned, words, own)
