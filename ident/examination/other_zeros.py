"""A position from another zero, or a number times too large, that leaves little more of the torques than is
usual, so that no other check speaks: told where one fit of all rows contradicts itself without it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ident.examination.check import Check
from ident.examination.hypothesis import Asked, Hypothesis, falls, of_several
from ident.examination.rivals import alike, of_positions, rivals
from ident.examination.stretches import ODD, RARE, Explained, agreed, all_rows, steadily
from ident.examination.unexplained import odd_beside


def other_zeros(asked: Asked) -> Iterator[Check]:
    """The one that explains most, where all along and by several torques it explains more, and nothing else
    does than it; with what explains as much. (Of a Franka whose third position was 10 degrees off 4 % were
    foretold for 2, and nothing was said; of eleven robots as they are none is told.)"""
    whole, how = all_rows(asked.quick), asked.how
    plain = Explained.by(whole, how)
    each = list(of_positions(whole, plain.fit, how))
    told = [
        r
        for r in each
        if of_several(whole.columns, plain.fit, r.explained.fit, [] if r.joint is None else [r.joint])
        and steadily(plain, r.explained, RARE)
        and agreed(plain, r.explained, RARE / len(each))
    ]
    if not told:
        return
    best = max(told, key=lambda r: r.explained.fit.gain_over(plain.fit))
    if odd_beside(best.explained.fit.error, best.explained.quick.alone(how)).any():
        return  # at most a part of what is wrong
    pool = [r for r in rivals(whole, how, asked.currents) if r.words != best.words]
    if any(agreed(best.explained, r.explained, ODD / len(pool)) for r in pool):
        return
    name = best.words.split()[0]
    check = Check(
        best.check,
        (name,),
        f"{best.words}: so taken, {falls(plain.fit, best.explained.fit)} over all recordings",
        f"check where {name} is zero, and its unit, in the log and in the robot file",
    )
    its = Hypothesis(best.explained.fit.gain_over(plain.fit), how, check, words=best.words)
    others = [r.words for r in alike(pool, plain, best.explained)]
    yield its.beside([replace(its, words=words) for words in others]).check
