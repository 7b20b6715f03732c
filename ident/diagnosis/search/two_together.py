"""Two effects that hide each other: as long as one is not in the model the judged rows reject the other, and
both say much together."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.metric import side_by_side
from ident.diagnosis.evidence.refine import Refined
from ident.diagnosis.evidence.settled import with_found
from ident.diagnosis.evidence.state import Found, State
from ident.diagnosis.evidence.sufficiency import short_of
from ident.diagnosis.search.candidates import Ranked
from ident.diagnosis.search.settling import Settled, refined_together
from ident.diagnosis.search.weighing import Weighed, compared, main_channel

PAIRS = 3  # that are judged


def two_together(state: State, weighed: Weighed, tau: float, alpha: float) -> Settled | None:
    """The first of two of the hypotheses of a round in which none holds, where each does beside the other;
    the next round finds the second. Which are asked the fitted rows say. (Of a fifth joint with couplings to
    the first and the fourth each said 65 nats there, and 10 against itself on the judged rows: 4.4 % of its
    torque were left for 1.)"""
    limit = tau + float(np.log(PAIRS))
    likely = [r for r, e in weighed.all if e.gain > tau and not r.at_bound]
    both = [(weigh(weighed.metric, side_by_side(a.columns, b.columns)), a, b) for a, b in _pairs(likely)]
    for evidence, a, b in sorted(both, key=lambda its: -its[0].gain)[:PAIRS]:
        if evidence.log_e <= limit or not evidence.supported(alpha):
            continue
        first = _held_beside(state, a, b, tau, alpha)
        if first is not None and _held_beside(state, b, a, tau, alpha) is not None:
            r, told = first
            found = refined_together(with_found(state, Found(r.term, r.columns, r.sizes)))
            return Settled(r, told, found)
    return None


def _pairs(likely: list[Refined]) -> Iterator[tuple[Refined, Refined]]:
    """Of other kinds or places that act on one channel at least."""
    for a, b in combinations(likely, 2):
        another = (a.term.effect, a.term.where) != (b.term.effect, b.term.where)
        contained = a.term.contains(b.term) or b.term.contains(a.term)
        if another and not contained and set(a.columns) & set(b.columns):
            yield a, b


def _held_beside(
    state: State, its: Refined, other: Refined, tau: float, alpha: float
) -> tuple[Refined, Evidence] | None:
    """One of them, where it holds with the other one in the model, and no function of what it reads says
    more: two laws may make up for a third one."""
    beside = with_found(state, Found(other.term, other.columns, other.sizes))
    weighed = compared(beside, [Ranked(its.term, 0.0)], tau, alpha)
    for r, evidence in weighed.passed:
        c = main_channel(evidence, r.term, beside)
        if short_of(beside, weighed.metric, r, evidence, c, tau) is None:
            return r, evidence
    return None
