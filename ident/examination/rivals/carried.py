"""Faults that the fitted recordings do not show, and without which the others would be predicted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ident.examination.check import Check
from ident.examination.fits.best_factor import best_factor
from ident.examination.fits.bodies import AS_OTHERS
from ident.examination.fits.hypothesis import Asked, of_several
from ident.examination.fits.own_factors import WORDS, each_by_itself
from ident.examination.fits.quick import Assignment, Fit, Quick, gain_of, gains_of
from ident.examination.fits.stretches import HALF, ODD, RARE, Explained, agreed, all_rows, steadily
from ident.examination.rivals.rivals import Rival, alike, gaining, rivals
from ident.examination.torques.signs import evidence

CARRIED, KEPT = 2.2, 0.3  # gain on identify and validate together, and what identify may lose by it
BEHIND = 0.5  # gain by which one fault is clearly behind another


@dataclass(frozen=True, slots=True)
class Carried:
    """A fault without which the model would predict validate, though the fitted recordings do not show it:
    gain on both together, what it is, and the gravity (3,) that it stands for, if it is one."""

    gain: float
    words: str
    gravity: np.ndarray | None = None


def carried(before: np.ndarray, after: np.ndarray, held: np.ndarray | None, now: np.ndarray | None) -> float:
    """Gain on identify (before, after) and validate (held, now) together, by errors (C,): minus infinity
    where a torque of validate is predicted worse than by nothing, or identify loses too much."""
    if held is None or now is None or not np.fmax.reduce(now) < 1.0 or gain_of(before, after) < -KEPT:
        return -np.inf
    return gain_of(before, after) + gain_of(held, now)


def carried_faults(asked: Asked) -> list[Carried]:
    """Faults that one number describes, each with the number with which validate is predicted best, where the
    best of them is so by far: it, and those that stretch by stretch are not rejected beside it, by one fit or
    by what is predicted. (Of a KR 300 with a torque times 0.7 in all of the fitted run, it was so "from about
    1.62 s on".)

    One fit of what is fitted and what judges has to contradict itself without the fault, but for chance that
    confirms one of all that are asked: a KR 300's slow motion does not foretell the other recording, nothing
    in the two together speaks for the factor of 40 with which it happened to."""
    whole, how = all_rows(asked.quick), asked.how
    plain = Explained.by(whole, how)
    others, count = gaining(rivals(asked, whole, how), plain)
    rate = ODD / (count + len(how.order))
    asks = (its for its in others if not its.beside and _moves(plain, its))
    likely = [its for its in asks if steadily(plain, its.explained, rate)]
    told = [its for its in _scales(asked, whole) if steadily(plain, its[1], rate)]
    told += _others(asked, likely, CARRIED)
    if not told:
        return []
    best, explained, held = max(told, key=lambda its: its[1].fit.gain_over(plain.fit))
    alone, clearly = each_by_itself(whole, how, asked.seen, explained)
    if clearly:
        return [Carried(best.gain, WORDS)]
    told = [its for its in told if _enough(asked.fit, plain.fit, its)]
    if not told:
        return []
    best, explained, held = max(told, key=lambda its: its[1].fit.gain_over(plain.fit))
    near = [its for its, so, _ in told if its is not best and not steadily(so, explained, RARE)]
    known = {its.words for its in (best, *near)}
    also = [its for its in alike(others, plain, explained) if its.words not in known]
    found = [its for its, _, so in _others(asked, also, HALF * best.gain) if not agreed(so, held, ODD)]
    found += [Carried(0.0, its.words) for its in also if its.explained.fit.gain_over(explained.fit) > 0]
    if alone:
        found.append(Carried(0.0, WORDS))
    return [best, *near, *{its.words: its for its in found}.values()]


Told = tuple[Carried, Explained, Explained]  # what fits all recordings with it undone, what is then predicted


def _moves(plain: Explained, its: Rival) -> bool:
    """Whether it is about no position, or the torques of its joint or several others speak for it."""
    after = its.explained.fit
    return its.joint is None or of_several(plain.quick.columns, plain.fit, after, [its.joint])


def _enough(before: Fit, together: Fit, told: Told) -> bool:
    """Whether the torque of which one fit explains most more without a fault is then predicted better, and is
    as near to what that fit leaves of it as the other torques are. (Of an AIRBOT whose positions were late a
    share of another torque was told, and three causes more: the third torque was still foretold ten times as
    badly as it is explained. Of a rokae with two rows of its table exchanged the sixth was, and worse.)"""
    _, explained, held = told
    assert before.validate is not None
    most = int(np.argmax(gains_of(together.error, explained.fit.error)))
    behind = -gains_of(explained.fit.error, held.fit.error)
    usual = float(np.median(np.delete(behind, most))) if len(behind) > 1 else 0.0
    return bool(held.fit.error[most] < before.validate[most] and behind[most] < usual + np.log(AS_OTHERS))


def _scales(asked: Asked, whole: Quick) -> Iterator[Told]:
    quick, fit, how = asked.quick, asked.fit, asked.how

    def gains(c: int, sign: int, factors: np.ndarray) -> list[float]:
        fits = quick.fits([how.times([c], sign * f) for f in factors])
        return [carried(fit.error, its.error, fit.validate, its.validate) for its in fits]

    for c in asked.seen:
        tried = [(best_factor(partial(gains, c, sign)), sign) for sign in (1, -1)]
        best, sign = max(tried, key=lambda its: its[0].gain)
        factor, absurd = sign * best.factor, max(its.absurd for its, _ in tried)
        taken = how.times([c], factor)
        enough = best.gain > max(CARRIED, absurd + BEHIND)
        if enough and not evidence(quick, quick.fit(taken), taken).against(c):
            its = Carried(best.gain, f"{asked.name(c)} times {factor:.2g}")
            held = _kept(quick, how, quick, taken, quick)
            if held is not None:
                yield its, Explained.by(whole, taken), held


def _others(asked: Asked, others: Sequence[Rival], least: float) -> Iterator[Told]:
    quick, fit, how = asked.quick, asked.fit, asked.how
    roles = [s.role for s in quick.samples if s.role != "test"]
    for rival in others:
        samples = [replace(s, role=role) for s, role in zip(rival.explained.quick.samples, roles)]
        taken = quick.of(samples)
        less = rival.explained.recorded is not rival.explained.quick
        recorded = quick if less else taken
        fitted, held = _explained(taken, how, recorded)
        value = carried(fit.error, fitted.fit.error, fit.validate, held.fit.error)
        if value > least and _kept(quick, how, taken, how, recorded) is not None:
            yield Carried(value, rival.words), rival.explained, held


def _kept(
    quick: Quick, how: Assignment, other: Quick, taken: Assignment, recorded: Quick
) -> Explained | None:
    """What is predicted of validate without a fault, where stretch by stretch it is predicted better, and
    identify not explained worse."""
    fitted, held = _explained(quick, how, quick)
    fitted_so, held_so = _explained(other, taken, recorded)
    return held_so if agreed(held, held_so, ODD) and not agreed(fitted_so, fitted, ODD) else None


def _explained(quick: Quick, how: Assignment, recorded: Quick) -> tuple[Explained, Explained]:
    """What a fit takes of the recordings that it is of, and of those that judge it."""
    its = Explained.less(quick, how, recorded)
    assert its.fit.validate is not None
    judging, before = (_judging(each) for each in (quick, recorded))
    return its, Explained(judging, replace(its.fit, error=its.fit.validate), how, before)


def _judging(quick: Quick) -> Quick:
    return quick.of([replace(s, role="identify") for s in quick.samples if s.role == "validate"])


def ambiguous(held: np.ndarray | None, told: Sequence[Carried]) -> Check:
    """All that would explain recordings that are foretold badly; none is believed."""
    assert held is not None
    words = "; ".join(its.words for its in sorted(told, key=lambda its: -its.gain))
    return Check(
        "poor_excitation",
        (),
        f"what is fitted does not predict the recordings that validate (errors of {span(held)}), and its "
        f"motions do not show why: {words}: "
        f"{'each of these' if len(told) > 1 else 'this'} alone would "
        f"{'explain' if len(told) > 1 else 'predict'} them far better, and it may be something else",
        "check each of them, and record a motion that moves all joints more",
    )


def span(error: np.ndarray) -> str:
    """Shares from the least to the greatest, in per cent."""
    least, most = (f"{100 * x:.{int(100 * x < 10)}f}" for x in (np.nanmin(error), np.nanmax(error)))
    return f"{least} %" if least == most else f"{least} to {most} %"
