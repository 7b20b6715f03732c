"""An explanation settled whole: its shapes, dry friction's turn-over and all that was found, taken again
beside it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ident.diagnosis.candidates import with_size
from ident.diagnosis.evidence import Evidence, metric, over, weigh
from ident.diagnosis.leading import leading_metric
from ident.diagnosis.refine import Refined, refine
from ident.diagnosis.state import Found, State, converged, settled, solved, with_found, without
from ident.diagnosis.sufficiency import sufficiency, sufficient
from ident.diagnosis.terms import Term
from ident.diagnosis.weighing import Weighed, holds, passes

ROUNDS, STAYS = 5, 0.03  # of a size: what it may still move by
SETTLED = 6  # explanations that are settled whole where the first one is not sufficient


def refined_together(state: State) -> State:
    """Shapes of all effects found, each beside the others, then the whole settled; again where an effect
    acts on the model's own torque, until its size stays: model and size answer each other."""
    for _ in range(ROUNDS):
        before = _sizes(state)
        state = _refined_once(state)
        after = _sizes(state)
        if set(before) != set(after) or all(abs(after[k] - before[k]) < STAYS * abs(after[k]) for k in after):
            break
    return state


def _sizes(state: State) -> dict[tuple, float]:
    """Of the effects found whose columns are made at a size."""
    return {f.term.key: f.term.size[0] for f in state.found if f.term is not None and f.term.size}


def _refined_once(state: State) -> State:
    for number, f in enumerate(state.found):
        if f.term is None or not (f.term.effect.nonlinear or f.term.size is not None):
            continue
        others = state.but(number)
        best = refine(others.metric, others.scene, f.term, turns=3)
        if not best.columns:
            continue
        term = best.term if best.term.size is None else with_size(best.term, best.sizes)
        found = list(state.found)
        found[number] = Found(term, best.columns, best.sizes)
        state = solved(replace(state, found=tuple(found)))
    return settled(converged(state), 1)


def place_of(state: State, term: Term) -> int | None:
    """Where a hypothesis stands among what was found; None: it acts nowhere any more."""
    places = (k for k, f in enumerate(state.found) if f.term is not None and f.term.key == term.key)
    return next(places, None)


def without_terms(state: State, terms: Iterable[Term]) -> State:
    """The state without those of the terms that are in it, settled again."""
    for term in terms:
        at = place_of(state, term)
        state = state if at is None else without(state, at)
    return state


def _afresh(state: State, r: Refined, joint: int | None) -> State:
    """A hypothesis settled in, dry friction's turn-over of the joint (None: of all) from all its range."""
    turns = {j: turn for j, turn in state.turns.items() if joint is not None and j != joint}
    return refined_together(with_found(replace(state, turns=turns), Found(r.term, r.columns, r.sizes)))


def _beside(trial: State, key: tuple) -> tuple[State, Refined]:
    """The rest of a state, and the hypothesis in it."""
    number = next(k for k, f in enumerate(trial.found) if f.term is not None and f.term.key == key)
    f = trial.found[number]
    assert f.term is not None
    return trial.but(number), Refined(f.term, f.columns, f.sizes, 0.0)


def settled_in(
    state: State, weighed: Weighed, best: Refined, c: int, tau: float, alpha: float
) -> tuple[Refined, Evidence, State] | None:
    """Of the first explanations of the leading channels the one that predicts the judged rows best among
    those that are sufficient once dry friction's turn-over, from all its range, and all shapes were taken
    again beside it: what it was compared with before may have taken its place in part."""
    out: tuple[float, Refined, Evidence, State] | None = None
    likely = [(r, e) for r, e in weighed.all if e.log_e > tau and set(r.columns) & set(best.columns)]
    for r, _ in sorted(likely, key=lambda its: -its[1].log_e)[:SETTLED]:
        trial = _afresh(state, r, state.model.channels[c].joint)
        if place_of(trial, r.term) is None:
            continue
        others, whole = _beside(trial, r.term.key)
        m = leading_metric(others, [whole])
        own = weigh(m, whole.columns)
        told = over(
            metric(state.rows, *state.design, m.whiteners), m, own
        )  # the model as it was did its best
        if not (holds(others, m, whole, own, tau, alpha) and passes(state, whole, told, tau, alpha)):
            continue
        flex = sufficiency(others, m, whole.term, c, tau)
        error = float(np.mean(trial.residual[c, trial.rows.judged & trial.rows.use[c]] ** 2))
        if sufficient(whole.term, own, flex, tau) and (out is None or error < out[0]):
            out = error, r, told, trial
    return None if out is None else out[1:]
