"""Positions by what every torque says of them by itself.

A torque that is turned, in another unit or of another drive keeps the bodies that all torques share from
explaining anything, and hides what is wrong with a position. Fitted with bodies of its own every torque is
explained whatever its sign and its factor are, and by the right motion alone. (Of a UR10e with a torque and
another joint's position turned a row of the robot file was told, of an LWR4+ another torque's sign.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.bodies import beyond_own
from ident.examination.fits.first_axis import FirstAxis, gravity_line, told_by
from ident.examination.fits.hypothesis import CLEARLY, SWAPPED, Asked, Hypothesis
from ident.examination.fits.quick import FLOOR, Assignment
from ident.examination.fits.sphere import degrees_between
from ident.examination.fits.stretches import RARE, ByItself, Explained, all_rows, steadily
from ident.examination.torques.signs import MOST_SIGNS, sign_patterns
from ident.examination.torques.smooth_torques import with_smooth_torques
from modelgen.geometry.kinematics import Geometry

ROWS = 400  # of all recordings
FACTORS = (0.5, 2.0)
GRID, FINE = np.pi / 6 * np.arange(-5, 7), 0.02  # rad, other zeros that are asked, and to how much


@dataclass(frozen=True, slots=True)
class Motion:
    """What is done to positions, in words, and every torque explained by itself."""

    check: str
    words: str
    signals: tuple[str, ...]
    change: dict[str, Any]  # of every signal, as a study has it
    moved: dict[str, Any]  # what `Quick.moved` takes
    explained: ByItself

    def gain_over(self, other: ByItself) -> float:
        return self.explained.fit.gain_over(other.fit)


def by_themselves(asked: Asked) -> ByItself:
    """Every torque by itself, of rows enough to judge by."""
    whole = all_rows(asked.quick)
    stride = max(1, sum(len(s.t) for s in whole.samples) // ROWS)
    return ByItself.by(whole.of([s.rows(slice(None, None, stride)) for s in whole.samples]), asked.how)


def moved_positions(asked: Asked, plain: ByItself, zeros: bool = True) -> Iterator[Hypothesis]:
    """Positions that are recorded otherwise where every torque by itself is explained so much better, fewest
    first, with those that stretch by stretch are not rejected beside the best. zeros: whether another zero,
    which a torque's own bodies make up for, is asked, too."""
    tried = [*_signs(asked, plain), *_factors(asked, plain), *(_zeros(asked, plain) if zeros else ())]
    best = max(tried, key=lambda its: its.gain_over(plain), default=None)
    if best is None or best.gain_over(plain) < SWAPPED:
        return
    alike = [its for its in tried if its is best or not steadily(its.explained, best.explained, RARE)]
    alike = [its for its in alike if _agree(its.explained) and _moves(asked, plain, its)]
    fewest = min((len(its.signals) for its in alike), default=0)
    told = [its for its in alike if len(its.signals) == fewest]
    told.sort(key=lambda its: -its.gain_over(plain))
    if told and steadily(plain, told[0].explained, RARE):
        first, *others = [_told(asked, its, plain) for its in told]
        yield first.beside(others)


def signed(each: ByItself) -> Explained | None:
    """One set of bodies for all torques, some turned as explains most; None where they are too many."""
    quick, how = each.quick, each.how
    seen = np.flatnonzero(np.isfinite(each.fit.error)).tolist()
    if not 0 < len(seen) <= MOST_SIGNS:
        return None
    ways = [how.times(which, -1.0) for which in sign_patterns(seen[1:])]
    told = (Explained(quick, fit, way) for fit, way in zip(quick.fits(ways), ways))
    return max(told, key=lambda its: its.fit.gain_over(each.fit))


def _moves(asked: Asked, plain: ByItself, its: Motion) -> bool:
    """Whether more is explained than by any smooth torque of these positions. (Of a spring on an arm's first
    joint q1 was told as 2 times too large.)"""
    joints = [k for k, label in enumerate(asked.joints) if f"q{label}" in its.signals]
    smooth = ByItself.by(with_smooth_torques(plain.quick, joints), asked.how)
    return steadily(smooth, its.explained, RARE)


def _agree(each: ByItself) -> bool:
    """Whether one set of bodies explains what each torque by itself does, with some of them turned."""
    told = signed(each)
    return told is not None and not beyond_own(told.fit.error, each.fit.error).any()


def _signs(asked: Asked, plain: ByItself) -> Iterator[Motion]:
    """One position with the other sign, or two."""
    places = np.arange(len(asked.joints))
    for which in (*combinations(places.tolist(), 1), *combinations(places.tolist(), 2)):
        names = tuple(f"q{asked.joints[j]}" for j in which)
        has, axis = ("has", "its axis") if len(which) == 1 else ("have", "their axes")
        words = f"{listed(names)} {has} the other sign (or {axis} in the robot file)"
        moved = {"factor": np.where(np.isin(places, which), -1.0, 1.0)}
        yield Motion("position_sign", words, names, {"sign": -1}, moved, _by(asked, plain, moved))


def _factors(asked: Asked, plain: ByItself) -> Iterator[Motion]:
    for j, label in enumerate(asked.joints):
        for factor in FACTORS:
            size, word = (1 / factor, "large") if factor < 1 else (factor, "small")
            moved = {"factor": np.where(np.arange(len(asked.joints)) == j, factor, 1.0)}
            words = f"q{label} is {size:.3g} times too {word}"
            yield Motion(
                "angle_unit", words, (f"q{label}",), {"scale": factor}, moved, _by(asked, plain, moved)
            )


def _zeros(asked: Asked, plain: ByItself) -> Iterator[Motion]:
    """Each turning joint from the zero with which torques by themselves are explained best."""
    for j, label in enumerate(asked.joints):
        if label in asked.quick.columns.model.prismatic:
            continue
        its = np.arange(len(asked.joints)) == j

        def at(x: float, its: np.ndarray = its) -> tuple[float, ByItself]:
            return x, _by(asked, plain, {"offset": np.where(its, x, 0.0)})

        known = dict(map(at, GRID))
        x = max(known, key=lambda tried: known[tried].fit.gain_over(plain.fit))
        step = float(GRID[1] - GRID[0])
        while step > FINE and known[x].fit.gain_over(plain.fit) > CLEARLY:
            step /= 2
            known |= dict(map(at, (x - step, x + step)))
            x = max(known, key=lambda tried: known[tried].fit.gain_over(plain.fit))
        best = known[x]
        words = f"q{label} starts from another zero, about {-x:.2g} rad off"
        change, moved = {"offset": float(f"{x:.2g}")}, {"offset": np.where(its, x, 0.0)}
        yield Motion("position_zero", words, (f"q{label}",), change, moved, best)


def _by(asked: Asked, plain: ByItself, moved: dict[str, Any]) -> ByItself:
    return ByItself.by(plain.quick.moved(**moved), asked.how)


def _told(asked: Asked, its: Motion, plain: ByItself) -> Hypothesis:
    a, b = (
        100 * float(np.exp(np.nanmean(np.log(np.fmax(x.fit.error, FLOOR))))) for x in (plain, its.explained)
    )
    fallen = f"so taken, the error of torques, each by itself, falls from {a:.0f} to {b:.0f} %"
    gain, moved = its.gain_over(plain), asked.quick.moved(**its.moved)
    with_torques = _turned_whole(asked, its)
    if with_torques is not None:
        axes = "axis" if len(its.signals) == 1 else "axes"
        joints = f"joint{'' if len(its.signals) == 1 else 's'} {listed(name[1:] for name in its.signals)}"
        words = (
            f"positions and torques of {joints} have the other sign than by the robot file, or it has the "
        )
        words += f"{axes} turned, as another robot's has"
        names = (*its.signals, *asked.names(np.flatnonzero(np.array(with_torques.factor) < 0).tolist()))
        line = asked.line({name: {"sign": -1} for name in names})
        check = Check("joint_axis", names, f"{words}: {fallen} (geometric mean)", line)
        return Hypothesis(gain, with_torques, check, moved, words, own=True)
    line = asked.line(dict.fromkeys(its.signals, its.change))
    if "offset" in its.change:  # nearly
        line = f"write {line}, or the zero that is known"
    check = Check(its.check, its.signals, f"{its.words}: {fallen} (geometric mean)", line)
    zero = Hypothesis(gain, asked.how, check, moved, its.words, own=True)
    table = Geometry.of(asked.quick.columns.model.geometry)
    first = FirstAxis.of(table, asked.joints)
    if "offset" not in its.change or first is None or its.signals != (first.name,):
        return zero
    told = np.array(table.gravity if asked.gravity is None else asked.gravity, float)
    gravity = first.turned(told, its.change["offset"])
    words = f"gravity is turned by {degrees_between(told, gravity):.0f} degrees"
    message = f"{words} against {told_by(asked.gravity)}'s: the base is mounted otherwise; {fallen}"
    mounted = Check("base_orientation", (), f"{message} (geometric mean)", gravity_line(gravity))
    return replace(zero, check=mounted, words=words).beside([zero])


def _turned_whole(asked: Asked, its: Motion) -> Assignment | None:
    """With the torques of turned positions turned, too, where those and no others are as all torques together
    have it: whole joints, as an axis of the robot file turns them. (Of a rokae with a Franka's file two
    positions were told to be turned, and a gain of -1.2.)"""
    told = signed(its.explained)
    joints = [str(asked.joints[j]) for j in asked.quick.columns.joint_of]
    own = [c for c, label in enumerate(joints) if f"q{label}" in its.signals and c in asked.seen]
    if its.check != "position_sign" or told is None or told.how != asked.how.times(own, -1.0):
        return None
    alone = Explained.by(its.explained.quick, asked.how)
    return told.how if told.fit.gain_over(alone.fit) > CLEARLY else None
