"""What the fitted rows say of an effect that the judged ones have chosen.

A split of the rows works both ways: sizes and shapes as the judged rows have them, the fitted rows are those
that chose nothing, and say as much of an effect as there is more of them (cross-fitting: Wasserman, Ramdas,
Balakrishnan, PNAS 117(29), 2020). Which effects are asked was told by the fitted rows, and so each pays for
all that could have been: the whole catalogue at every place, and not those on a list. The judged rows keep
their say as by_halves gives it. (A spring planted in an AIRBOT's third joint took its error from 13 to 7 %,
on runs that were for nothing else from 19 to 8; of 20 s of a validate run 8.0 nats were left beside slow
noise of any size where 8.3 are asked, of the 40 s of the fitted runs 37.)"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.metric import Columns, Metric
from ident.diagnosis.evidence.refine import Refined
from ident.diagnosis.evidence.state import State
from ident.diagnosis.outcome import BUDGET
from ident.diagnosis.search.halves import (
    foretells,
    holds_by_halves,
    in_its_noise,
    is_left_of_a_law,
    judged_by,
)
from ident.diagnosis.search.in_common import holds_in_common
from ident.diagnosis.search.weighing import Weighed, best_held


def by_exchange(
    state: State, weighed: Weighed, tau: float, alpha: float
) -> tuple[Refined, Evidence, tuple[tuple[Refined, Evidence], ...]] | None:
    """Of the hypotheses that the fitted rows show as the judged ones have them the simplest of the best, and
    what else they show; None where they show nothing."""
    likely = [
        r
        for r, e in weighed.all
        if min(e.gain - tau, e.log_e) > 0
        and not r.at_bound
        and not is_left_of_a_law(state, r)
        and foretells(state, r, e)
    ]
    if not likely:
        return None
    side = exchanged(state)
    m = in_its_noise(side, weighed.metric)
    told = [(r, judged_by(side, m, r, tau, alpha, price(state))) for r in likely]
    return best_held([(r, e) for r, e in told if e is not None], tau)


def holds_exchanged(state: State, columns: Columns, tau: float) -> bool:
    """Whether the fitted rows ask for columns as the judged ones have them, and these do not speak against
    them as the fitted rows have them; state: without them."""
    return by_the_fitted(state, columns)[1].log_e > tau and weigh(state.metric, columns).log_e > 0


def by_the_fitted(state: State, columns: Columns) -> tuple[Metric, Evidence]:
    """What the fitted rows say of columns as the judged ones have them, paid; and the metric of that."""
    m = exchanged(state).metric
    e = weigh(m, columns)
    return m, replace(e, log_e=e.log_e - price(state))


def exchanged(state: State) -> State:
    """The judged rows fitted, and the fitted ones judging."""
    rows = state.rows
    return replace(state, rows=replace(rows, fitted=rows.judged, judged=rows.fitted))


def price(state: State) -> float:
    """Nats for all of the catalogue that could have been asked, of which tau pays for BUDGET."""
    return float(np.log(max(state.problem.asked / BUDGET, 1.0)))


def shown_by_fitted(state: State, columns: Columns, sizes: np.ndarray, tau: float) -> bool:
    """Whether what the judged rows alone do not show is asked for by both halves of the fitted rows, by the
    judged ones given these, or by these as the judged ones have it; state: without it."""
    return (
        holds_by_halves(state, columns, sizes, tau)
        or holds_in_common(state, columns, sizes, tau)
        or holds_exchanged(state, columns, tau)
    )
