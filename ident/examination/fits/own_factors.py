"""Torques of which each is times a factor of its own: in currents, in per cent of what each drive is rated.

One of them alone, scaled, explains a part of it. (Of a Franka whose torques were all in mA the fifth was told
to be 0.63 times what it is.) Factors are sought on half of the stretches of the recordings and judged on the
other half, so that of torques that need none their number gains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ident.examination.fits.quick import Assignment, Quick
from ident.examination.fits.stretches import RARE, Explained, beyond_chance, pieces, stretch_gains

WORDS = "each torque is times a number of its own, as currents are or per cent of what each drive is rated"
TURNS = 4
WIDEST, FINEST = 4.0, 1.1  # steps of a factor, from turn to turn smaller
STEPS = np.arange(-3, 4)


def own_factors(quick: Quick, how: Assignment, seen: Sequence[int]) -> Assignment:
    """That of every torque with which all are explained most, one after the other."""
    for step in np.geomspace(WIDEST, FINEST, TURNS):
        for c in seen:
            tried = [how.times([c], float(f)) for f in step**STEPS]
            fits = quick.fits(tried)
            how = tried[int(np.argmax([fit.gain_over(fits[len(STEPS) // 2]) for fit in fits]))]
    return how


def each_by_itself(whole: Quick, how: Assignment, seen: Sequence[int], told: Explained) -> tuple[bool, bool]:
    """Whether stretch by stretch factors of their own, sought on the others, explain more than what is told;
    and whether more than that with another torque's factor beside it, too: a robot may lack something of its
    own, which takes a second one."""
    halves: list[list[Any]] = [
        [s.rows(np.concatenate(pieces(whole, s)[k::2])) for s in its.fitted]
        for its in (whole, told.quick)
        for k in (0, 1)
    ]
    hows = [own_factors(whole.of(halves[k]), how, seen) for k in (0, 1)]

    def beyond(its: Assignment) -> bool:
        gains = []
        for k in (0, 1):
            judged, so = whole.of(halves[1 - k]), told.quick.of(halves[3 - k])
            gains.append(stretch_gains(Explained.by(so, its), Explained.by(judged, hows[k])))
        return beyond_chance(np.concatenate(gains), RARE)

    if not beyond(told.how):
        return False, False
    changed = [c for c in seen if told.how.factor[c] != how.factor[c]]
    pairs = [own_factors(told.quick, told.how, [*changed, c]) for c in seen if c not in changed]
    fits = told.quick.fits([told.how, *pairs])
    return True, beyond(pairs[int(np.argmax([fit.gain_over(fits[0]) for fit in fits[1:]]))])
