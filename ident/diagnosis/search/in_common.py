"""What the judged rows show only together with the fitted ones: by the parameters that both have in common.

On the judged rows alone the model's own parameters stay free, and a short run holds next to nothing that they
do not answer: of a spring that takes a Franka's error there from 16 to 3 % seven nats were left. Given the
fitted rows they are not free. With flat priors on the model's parameters the ratio of what two models say of
all rows is a martingale over rows that come one after the other (residual contrasts, as in evidence.py), so

    log E = log E(all rows) - log E(fitted rows),   everything about the hypothesis chosen on the fitted rows

is bounded as the judged rows' own is. It takes the parameters for the same in all recordings, which another
friction or load is not: so with the hypothesis they must be. That the judged runs have parameters of their
own is the explanation without a name here, and must not say more than tau beyond it."""

from __future__ import annotations

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence
from ident.diagnosis.evidence.given import given_fitted
from ident.diagnosis.evidence.metric import Columns
from ident.diagnosis.evidence.refine import Refined
from ident.diagnosis.evidence.state import State
from ident.diagnosis.evidence.sufficiency import sufficiency, sufficient
from ident.diagnosis.search.halves import foretells, is_left_of_a_law
from ident.diagnosis.search.weighing import Weighed, best_held, holds, main_channel


def by_common(
    state: State, weighed: Weighed, tau: float, alpha: float
) -> tuple[Refined, Evidence, tuple[tuple[Refined, Evidence], ...]] | None:
    """Of the hypotheses that the judged rows show given the fitted ones the simplest of the best, and what
    else does; None where nothing does."""
    m, held = weighed.metric, []
    both = m.both
    for r, e in weighed.all:
        if not e.gain > tau or r.at_bound or is_left_of_a_law(state, r):
            continue
        given = given_fitted(m, both, r.columns, e.sizes)
        told = given.of(e)
        if given.differ > tau or told.contradicted(alpha) or not holds(state, m, r, told, tau, alpha):
            continue
        if not foretells(state, r, told):
            continue
        flex = sufficiency(state, m, r, main_channel(told, r.term, state), tau)
        if sufficient(r.term, told, flex, tau):
            held.append((r, told))
    return best_held(held, tau)


def holds_in_common(state: State, columns: Columns, sizes: np.ndarray, tau: float) -> bool:
    """Whether the judged rows ask for what was found given the fitted ones; state: without it."""
    given = given_fitted(state.metric, state.metric.both, columns, sizes)
    return bool(given.differ < tau and given.per_channel.sum() > tau)
