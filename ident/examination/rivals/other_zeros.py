"""A position from another zero, or a number times too large, that leaves little more of the torques than is
usual, so that no other check speaks: told where one fit of all rows contradicts itself without it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ident.examination.check import Check
from ident.examination.fits.hypothesis import EXPLAINED, SWAPPED, Asked, Hypothesis, falls, of_several
from ident.examination.fits.quick import Assignment, Quick, gains_of
from ident.examination.fits.stretches import (
    HALF,
    ODD,
    RARE,
    Explained,
    agreed,
    all_rows,
    beyond_chance,
    half_of,
    steadily,
    stretch_gains,
)
from ident.examination.fits.unexplained import by_each_recording, odd_beside
from ident.examination.rivals.recordings_apart import thinned
from ident.examination.rivals.rivals import Rival, alike, of_positions, standing
from ident.examination.rivals.scales import USUAL, ends

FARTHEST, TRIED = 3.0, 61  # times the zero that explains most, and how many up to there


def other_zeros(asked: Asked) -> Iterator[Check]:
    """The one that explains most, where all along and by several torques it explains more, and nothing else
    does than it; with what explains as much. (Of a Franka whose third position was 10 degrees off 4 % were
    foretold for 2, and nothing was said; of eleven robots as they are none is told.)"""
    whole, how = all_rows(asked.quick), asked.how
    if not _told(whole.of([thinned(s) for s in whole.samples]), how, ODD):  # in a fifth of the time
        return
    plain, told = Explained.by(whole, how), _told(whole, how, RARE)
    if not told:
        return
    best = max(told, key=lambda r: r.explained.fit.gain_over(plain.fit))
    if odd_beside(best.explained.fit.error, best.explained.quick.alone(how)).any():
        return  # at most a part of what is wrong
    pool = standing(asked, whole, how, best.explained, best.words)
    if pool is None:
        return
    name, words = best.words.split()[0], best.words + _within(best, plain, how)
    check = Check(
        best.check,
        (name,),
        f"{words}: so taken, {falls(plain.fit, best.explained.fit)} over all recordings",
        f"check where {name} is zero, and its unit, in the log and in the robot file",
        open=True,
    )
    its = Hypothesis(best.explained.fit.gain_over(plain.fit), how, check, words=words)
    near = [*_hardly_behind(pool, plain, best), *alike(pool, plain, best.explained)]
    yield its.beside([replace(its, words=r.words) for r in near]).check


def _within(best: Rival, plain: Explained, how: Assignment) -> str:
    """Between which zeros none is rejected beside the one that explains most. (Of a rokae's second position,
    10 degrees off, 0.22 rad were told.)"""
    if best.zeros is None:
        return ""
    number, motion = best.zeros
    numbers = number * np.linspace(0, FARTHEST, TRIED)
    _, *span = ends(numbers, [Explained.by(motion(x), how) for x in numbers], plain.fit)
    low, high = sorted(-x for x in span)
    return f" ({low:.2g} to {high:.2g} by these torques)"


def _hardly_behind(pool: Sequence[Rival], plain: Explained, best: Rival) -> list[Rival]:
    """Other zeros by which hardly less is explained, of the same torques: what robots lack makes one explain
    a little more than another, all along. (Of an AIRBOT's third position that of the second was told.)"""
    same = [r for r in pool if r.check == best.check and half_of(plain, best.explained, r.explained)]
    return [r for r in same if best.explained.fit.gain_over(r.explained.fit) < USUAL]


def _told(quick: Quick, how: Assignment, rate: float) -> list[Rival]:
    """Zeros and numbers of positions that explain more all along, but for chance at this rate."""
    plain = Explained.by(quick, how)
    each = list(of_positions(quick, plain.fit, how))
    return [
        r
        for r in each
        if r.settled
        and _several(plain, r)
        and steadily(plain, r.explained, rate / len(each))
        and agreed(plain, r.explained, rate if _as_others(plain, r) else rate / len(each))
        and _most_of_it(plain, r.explained)
    ]


def _as_others(plain: Explained, its: Rival) -> bool:
    """Whether it explains as much as any other position has to: amounts, which differ a thousandfold from
    stretch to stretch, then only confirm it. (Of a UR10e with the table of a KR 300 a first position that is
    3 times too large was told, by half of that.)"""
    return its.explained.fit.gain_over(plain.fit) > SWAPPED


def _several(plain: Explained, its: Rival) -> bool:
    """Whether its own torque speaks for it, or several do, or what one that is explained says the others
    confirm, be it little. (Of an AIRBOT's second to fourth position 10 degrees off the fifth torque says 70
    to 85 %, and 17 % of it were left for 8. Of a clipped LWR4+'s last torque, which is hardly any, 65 % are
    left for 20 with another zero before it.)"""
    most, joints = int(np.argmax(its.explained.gains_over(plain))), [] if its.joint is None else [its.joint]
    of_amount = of_several(plain.quick.columns, plain.fit, its.explained.fit, joints)
    explained = plain.fit.error[most] <= EXPLAINED  # else something else is missing
    return of_amount or (explained and beyond_chance(stretch_gains(plain, its.explained, but=most), ODD))


def _most_of_it(plain: Explained, its: Explained) -> bool:
    """Whether the torque that speaks for it most is then nearer to what fits of each recording leave of it
    than before: else what it explains is a part of something else. (Of a Barrett whose first link was longer
    by 0.3 m in the file, 2.9 % for 1.6 by fits of each, a zero that leaves 2.6 was told.)"""
    gains = its.gains_over(plain)
    most = int(np.argmax(gains))
    own = gains_of(plain.fit.error, by_each_recording(its.quick, its.how))
    return bool(gains[most] > HALF * own[most])
