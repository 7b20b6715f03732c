"""One joint's torque or its position with the other sign, and whether the recordings tell which.

A joint whose position is turned is its mirror image with the torque turned: its own friction and gravity fit
either. What it shares with other joints tells them apart, stretch by stretch; where that is too little both
are named.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ident.examination.check import Check, listed, turned_sign
from ident.examination.fits.hypothesis import CLEARLY, SWAPPED, Asked, Hypothesis, falls
from ident.examination.fits.stretches import RARE, Explained, all_rows, steadily
from ident.examination.fits.unexplained import contradicted
from ident.examination.torques.signs import Evidence, evidence
from modelgen.geometry.kinematics import Geometry

WORSE = 0.05  # loss at which a sign is not asked further


def one_turned(asked: Asked) -> Iterator[Hypothesis]:
    """One torque with the other sign, or its joint's position where that explains as much or more."""
    quick, fit, how = asked.quick, asked.fit, asked.how
    seen: Evidence | None = None
    for c in asked.seen:
        flipped = how.times([c], -1.0)
        other = quick.fit(flipped)
        gain = other.gain_over(fit)
        if gain < -WORSE:
            continue
        seen = seen or evidence(quick, fit, how)
        after = evidence(quick, other, flipped)
        alone = seen.against(c) and after.speaks_for(c) and _says_itself(asked, c)
        if not alone and (not asked.better(other, CLEARLY) or after.against(c)):
            continue
        name, joint = asked.name(c), quick.columns.channels[c][5:]
        if seen.against(c):
            why = f"friction or inertia of joint {joint} comes out negative"
        elif other.error[c] < fit.error[c]:
            of, to = (f"{100 * x.error[c]:.0f}" for x in (fit, other))
            why = f"turned, the error of joint {joint}'s torque falls from {of} to {to} %"
        else:
            why = f"turned, {falls(fit, other)}"
        said = f"{name} has the other sign"
        check = turned_sign((name,), f"{said}: {why}", asked.maps)
        its = Hypothesis(gain + (1.0 if alone else 0.0), flipped, check, words=said, own=alone)
        yield _which(asked, c, its)


def _says_itself(asked: Asked, c: int) -> bool:
    """Whether a torque that the others contradict is against its sign in a fit of itself alone, too: in
    one of all its friction may be what is wrong with them. (Of an LWR4+ with two positions and two torques
    exchanged the second torque was told as turned.)"""
    if not contradicted(asked)[c]:
        return True
    others = [k for k in asked.seen if k != c]
    its = asked.quick.of([s.without(others) for s in asked.quick.samples])
    return evidence(its, its.fit(asked.how), asked.how).against(c)


def _which(asked: Asked, c: int, torque: Hypothesis) -> Hypothesis:
    """A torque turned, its joint's position in its place, or the torque with the position named beside it."""
    return _told_apart(
        asked, torque, turned_position(asked, int(asked.quick.columns.joint_of[c]), torque.own)
    )


def all_turned(asked: Asked, torques: Hypothesis) -> Hypothesis:
    """All torques with the other sign, or all positions: friction and inertia say either, gravity which. (Of
    a Franka's positions, that was told of its torques.)"""
    moved = asked.quick.moved(factor=-np.ones(len(asked.joints)))
    names, other = [f"q{label}" for label in asked.joints], moved.fit(asked.how)
    words = "all positions have the other sign (or all axes in the robot file)"
    line = asked.line({name: {"sign": -1} for name in names})
    check = Check("position_sign", tuple(names), f"{words}: turned, {falls(asked.fit, other)}", line)
    return _told_apart(asked, torques, Hypothesis(torques.gain, asked.how, check, moved, words))


def _told_apart(asked: Asked, torque: Hypothesis, position: Hypothesis) -> Hypothesis:
    """The one that stretch by stretch explains more; the torque and the position where none does."""
    assert position.quick is not None
    one = Explained.by(all_rows(asked.quick), torque.how)
    other = Explained.by(all_rows(position.quick), asked.how)
    if steadily(other, one, RARE):
        return torque
    return position if steadily(one, other, RARE) else torque.beside([position])


def turned_positions(asked: Asked) -> Iterator[Hypothesis]:
    """One position with the other sign, by what all torques say of it; with its own torque, too, where the
    joint turns the other way than in the robot file."""
    for j in range(len(asked.joints)):
        its = turned_position(asked, j)
        for turned in (its, _turned_joint(asked, its, j)):
            if asked.better(asked.after(turned).fit, SWAPPED):
                yield turned


def _turned_joint(asked: Asked, position: Hypothesis, j: int) -> Hypothesis:
    """A joint's position and torque with the other sign. (About a vertical axis before it this is half a turn
    in the next row of the table: of four measured arms that was told, or nothing.)"""
    own = np.flatnonzero(asked.quick.columns.joint_of == j).tolist()
    names = (*position.check.signals, *asked.names(own))
    its = replace(position, how=asked.how.times(own, -1.0))
    other = asked.after(its).fit
    rows = Geometry.of(asked.quick.columns.model.geometry).rows
    link = [k for k, row in enumerate(rows, 1) if row.sigma != 2][j]
    said = f"{listed(names)} have the other sign"
    axis = f"the axis of joint {asked.joints[j]} (link {link}) points the other way in the robot file"
    message = f"{said}, or {axis}: turned, "
    line = asked.line({name: {"sign": -1} for name in names})
    check = replace(position.check, signals=names, message=message + falls(asked.fit, other), remedy=line)
    return replace(its, gain=other.gain_over(asked.fit), check=check, words=said)


def turned_position(asked: Asked, j: int, own: bool = False) -> Hypothesis:
    """The position of a joint, by its place among them, with the other sign. own: its friction says so."""
    label = asked.joints[j]
    turned = asked.quick.moved(factor=np.where(np.arange(len(asked.joints)) == j, -1.0, 1.0))
    other = turned.fit(asked.how)
    check = Check(
        "position_sign",
        (f"q{label}",),
        f"the position of joint {label} looks recorded with the other sign, or its axis in the robot file "
        f"points the other way: turned, {falls(asked.fit, other)}",
        asked.line({f"q{label}": {"sign": -1}}),
    )
    gain = other.gain_over(asked.fit) + (1.0 if own else 0.0)
    words = f"q{label} has the other sign (or its axis in the robot file)"
    return Hypothesis(gain, asked.how, check, turned, words, own)
