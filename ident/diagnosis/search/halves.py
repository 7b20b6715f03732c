"""What the rows that judge cannot show, judged by halves of the fitted ones.

Where a run that judges moves less than the fitted ones, what an effect does there is what the model's own
parameters, which stay free, do as well: such rows hold no contrast for it, whatever is true. Then each half
of the fitted rows judges what the other chose, by everything that is asked elsewhere. The search has seen
both: that both must say so, each at the limit, is what it pays with. The rows that judge keep their say: they
must not speak against it, and it must foretell them better."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, unseen, weigh
from ident.diagnosis.evidence.leading import with_hypothesis
from ident.diagnosis.evidence.metric import Columns, Metric, metric
from ident.diagnosis.evidence.refine import Refined, refine
from ident.diagnosis.evidence.state import State
from ident.diagnosis.evidence.sufficiency import signals_read, sufficiency, sufficient
from ident.diagnosis.rows.rows import Rows, halved
from ident.diagnosis.search.weighing import Weighed, best_held, holds, main_channel


def by_halves(
    state: State, weighed: Weighed, tau: float, alpha: float
) -> tuple[Refined, Evidence, tuple[tuple[Refined, Evidence], ...]] | None:
    """Of the hypotheses that the judged rows cannot show the simplest of the best, with its evidence on the
    half that says less; and what else held. None where nothing does."""
    hidden = [
        r
        for r, e in weighed.all
        if not is_left_of_a_law(state, r)
        and unseen(weighed.metric, r.columns, e.sizes, tau)
        and e.log_e > -tau
        and foretells(state, r, e)
    ]
    if not hidden:
        return None
    sides = [replace(state, rows=rows) for rows in halves(state.rows)]
    metrics = [in_its_noise(side, weighed.metric) for side in sides]
    held = []
    for r in hidden:
        told = [judged_by(side, m, r, tau, alpha) for side, m in zip(sides, metrics)]
        if all(t is not None for t in told):
            held.append((r, min((t for t in told if t is not None), key=lambda t: t.log_e)))
    return best_held(held, tau)


def is_left_of_a_law(state: State, r: Refined) -> bool:
    """Whether an effect found on its joint reads the same signals: what is left there is first of all what
    that law is wrong by, and a second one needs rows that judge."""
    read = signals_read(r.term)
    known = [signals_read(t) for t in state.terms if t.place.joint == r.term.place.joint]
    return read is not None and any(k is not None and read <= k for k in known)


def holds_by_halves(state: State, columns: Columns, sizes: np.ndarray, tau: float) -> bool:
    """Whether what the judged rows of a state cannot show is asked for by both halves of the fitted ones."""
    if not unseen(state.metric, columns, sizes, tau):
        return False
    return all(e.log_e > tau for _, e in on_halves(state, columns))


def on_halves(state: State, columns: Columns) -> Iterator[tuple[Metric, Evidence]]:
    """What each half of the fitted rows says of columns as the other has them; state: without them."""
    for rows in halves(state.rows):
        m = replace(state, rows=rows).metric
        yield m, weigh(m, columns)


def halves(rows: Rows) -> tuple[Rows, Rows]:
    """The fitted rows alone, each half judging the other."""
    first, second = halved(rows)
    return replace(rows, fitted=first, judged=second), replace(rows, fitted=second, judged=first)


def in_its_noise(side: State, m: Metric) -> Metric:
    """Of the same rows, parted in another way."""
    design, B = side.design
    return metric(side.rows, design, B, m.whiteners)


def judged_by(
    side: State, m: Metric, r: Refined, tau: float, alpha: float, price: float = 0.0
) -> Evidence | None:
    """What the judged rows of a side say of it as its fitted ones have it, less a price [nats]; None where it
    does not hold."""
    own = refine(m, side.scene, r.term, turns=2)
    if not own.columns:
        return None
    e = weigh(m, own.columns)
    e = replace(e, log_e=e.log_e - price)
    if not holds(side, m, own, e, tau, alpha):
        return None
    flex = sufficiency(side, m, own, main_channel(e, own.term, side), tau)
    return e if sufficient(own.term, e, flex, tau) else None


def foretells(state: State, r: Refined, e: Evidence) -> bool:
    """Whether the judged rows are foretold better with it, by the parameters of the fitted rows: where it
    says most, and by the geometric mean of the channels' errors. (By the sum of their squares one that no
    model explains outweighs all others: of an AIRBOT a spring halved the error of joint 3, and a twelfth more
    of joint 4, a third of whose torque was left, forbade it.)"""
    trial, c = with_hypothesis(state, r), main_channel(e, r.term, state)
    on = state.rows.use & state.rows.judged
    told = on.any(axis=1)
    before, after = (np.sum(np.where(on, s.residual, 0.0) ** 2, axis=1) for s in (state, trial))
    change = np.log(np.maximum(after, 1e-300) / np.maximum(before, 1e-300))
    return bool(change[c] < 0 and change[told].sum() < 0)
