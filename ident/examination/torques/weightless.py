"""A torque that was recorded less what the controller adds to carry the arm: gravity does not show in it.

Model and motion are right, the column is another signal, so that no factor, sign or place of a torque
explains it. (Of a UR10e whose second torque was so compensated the third one was told as 1.7 times too
large, of an LWR4+ the second as 2 times too small; of a UR10e, a Franka and a TX40 with all of them
compensated nothing was said, and all first moments came out at nothing.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.hypothesis import CLEARLY, Asked, Hypothesis, falls
from ident.examination.fits.quick import Quick, alone, gain_of
from ident.examination.fits.samples import at_rest, of_bodies
from ident.examination.fits.stretches import RARE, Explained, all_rows, steadily

LEAST = 1e-6  # of what the channel feels that feels most: a vertical axis of a table with rounded angles


def weightless(asked: Asked) -> Iterator[Hypothesis]:
    """One torque without gravity, or all that feel it."""
    quick, how = asked.quick, asked.how
    heavy = [c for c in felt(quick) if c in asked.seen]
    if not heavy:
        return
    plain, bare = None, without_gravity(quick, heavy)
    for which in every(heavy):
        least = CLEARLY if len(which) == 1 else 0.0
        taken = quick.partly(bare, which)
        if _most_gain(asked, taken, which) < least or not asked.better(taken.fit(how), least):
            continue
        plain, explained = plain or Explained.by(all_rows(quick), how), Explained.by(all_rows(taken), how)
        if steadily(plain, explained, RARE):
            its = _told(asked, which, taken)
            yield its if len(which) > 1 else _or_friction(asked, its, which, explained)


def _or_friction(asked: Asked, its: Hypothesis, which: Sequence[int], explained: Explained) -> Hypothesis:
    """One torque without gravity; beside one that shows no body at all where that explains as much. (Of three
    arms one that held its joint's velocity was told to be compensated.)"""
    bodies = of_bodies(asked.quick.columns)
    bare = asked.quick.of([s.lacking(bodies, which) for s in asked.quick.samples])
    if steadily(Explained.by(all_rows(bare), asked.how), explained, RARE):
        return its
    words = f"{asked.name(which[0])} shows friction alone, as its joint's velocity in its place does"
    fallen = falls(asked.fit, bare.fit(asked.how))
    remedy = f"check its column, or leave it out with {asked.left_out(which)}"
    check = Check("unrelated_torque", its.check.signals, f"{words}: so taken, {fallen}", remedy)
    return replace(its, check=check, quick=bare, words=words).beside([its])


def unfelt(asked: Asked) -> Iterator[Check]:
    """Said where all recordings are explained no worse without gravity: nothing shows it."""
    heavy = [c for c in felt(asked.quick) if c in asked.seen]
    if not heavy:
        return
    plain, other = (
        Explained.by(all_rows(x), asked.how) for x in (asked.quick, without_gravity(asked.quick, heavy))
    )
    if other.fit.gain_over(plain.fit) > 0 and not steadily(other, plain, RARE):
        size = [100 * float(np.nanmedian(its.fit.error)) for its in (plain, other)]
        yield Check(
            "poor_excitation",
            asked.names(heavy),
            f"these torques do not show gravity: without it the model explains them about as well (a median "
            f"error of {size[1]:.0f} %, not {size[0]:.0f} %), as torques that are logged less what the "
            "controller adds to carry the arm, or a motion that hardly lifts it",
            "make sure that they are what the joints give; first moments are not measured here",
        )


def every(heavy: Sequence[int]) -> list[list[int]]:
    """What may lack gravity together of these channels: each, and all."""
    return [[c] for c in heavy] + ([list(heavy)] if len(heavy) > 1 else [])


def felt(quick: Quick) -> list[int]:
    """Channels that feel gravity, as no offset does."""
    s = quick.fitted[0]
    weights = np.ptp(at_rest(quick.columns, s.payload, s.q[::10]), axis=1).max(axis=1)
    return np.flatnonzero(weights > LEAST * weights.max()).tolist()


def without_gravity(quick: Quick, which: Sequence[int], label: str | None = None) -> Quick:
    """Some torques without gravity, in all recordings or in one."""
    mine = [label in (None, s.label) for s in quick.samples]
    return quick.of(
        [s.without_gravity(quick.columns, which) if its else s for s, its in zip(quick.samples, mine)]
    )


def _most_gain(asked: Asked, taken: Quick, which: Sequence[int]) -> float:
    """No fit of all torques can gain more: every channel fitted by itself."""
    own = asked.alone.copy()
    size, v = taken.identify.right(asked.how)
    for c in which:
        own[c] = alone(taken.identify.G[c], v[c][:, None], size[[c]])[0]
    return gain_of(asked.fit.error, own)


def _told(asked: Asked, which: Sequence[int], taken: Quick) -> Hypothesis:
    names, other, one = asked.names(which), taken.fit(asked.how), len(which) == 1
    said = f"{listed(names)} {'does' if one else 'do'} not feel gravity"
    remedy = (
        f"log it with the controller's gravity torque, or leave it out with {asked.left_out(which)}"
        if one
        else "gravity: [0, 0, 0]  # or log them with the controller's gravity torque, to see first moments"
    )
    check = Check(
        "gravity_compensated",
        names,
        f"{said}, as a torque that is logged less what the controller adds to carry the arm: so taken, "
        f"{falls(asked.fit, other)}",
        remedy,
    )
    return Hypothesis(other.gain_over(asked.fit), asked.how, check, taken, said)
