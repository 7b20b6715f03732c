"""What the last fit leaves out goes out of the loop's model as well: what was found beside it, which it may
have made to look right, has to hold without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ident.diagnosis.evidence.evidence import Evidence
from ident.diagnosis.evidence.leading import leading_metric
from ident.diagnosis.evidence.metric import Metric
from ident.diagnosis.evidence.refine import Refined
from ident.diagnosis.evidence.settled import without
from ident.diagnosis.evidence.state import Found, State
from ident.diagnosis.extended.in_a_study import is_told
from ident.diagnosis.extended.last_fit import Refusal
from ident.diagnosis.left_over import leftovers
from ident.diagnosis.outcome import Outcome, Step
from ident.diagnosis.search.exchanged import shown_by_fitted
from ident.diagnosis.search.parameters_apart import spoken, spoken_given
from ident.diagnosis.search.settling import place_of, refined_together, without_terms
from ident.diagnosis.search.weighing import holds
from ident.diagnosis.weighed_again import pruned
from ident.estimation.fit import FitResult


def remaining(outcome: Outcome, last: FitResult, refused: Mapping[tuple, Refusal], alpha: float) -> Outcome:
    """The outcome without the effects that the last fit does without (those that it could not be made of, or
    tells too poorly, `refused`, stay and are told as that), nor those that do not hold then; what is left is
    asked for again. The outcome itself where all are there."""
    stay = {key for key, why in refused.items() if why.errors is None}
    gone = [s.term for s in outcome.steps if not is_told(last, s.term) and s.term.key not in stay]
    if not gone:
        return outcome
    state, steps, tau = outcome.last, list(outcome.steps), outcome.tau
    steps = [step for step in steps if step.term not in gone]
    state, steps = pruned(refined_together(without_terms(state, gone)), steps, tau, alpha)
    while (weak := _weakest(state, tau, alpha)) is not None:
        untrue = state.found[weak].term
        steps = [step for step in steps if untrue is None or step.term.key != untrue.key]
        state = without(state, weak)
    steps = [_weighed_again(state, step, tau) for step in steps]
    first = [u for u in outcome.unnamed if u.nearest is not None]  # asked for; the others were left over
    state, steps, left = leftovers(state, steps, first, tau, alpha)
    here = {(u.channel, u.variables) for u in first}
    left = [u for u in left if (u.channel, u.variables) not in here]
    return replace(outcome, last=state, steps=tuple(steps), unnamed=(*first, *left))


def _weakest(state: State, tau: float, alpha: float) -> int | None:
    """The number of what holds least, if it does not hold."""
    out: tuple[float, int] | None = None
    for number, f in enumerate(state.found):
        if f.term is None or f.term.place.recording is not None:
            continue  # a load on one recording has been asked for by `pruned`
        others = state.but(number)
        r, e, m = _beside(others, f, tau)
        if holds(others, m, r, e, tau, alpha) or shown_by_fitted(others, f.columns, f.sizes, tau):
            continue
        given = None  # a late torque is asked as it was found (`in_time`)
        if f.term.effect.shifts_time:
            given = spoken_given(m, f, e, tau)
        if given is not None and holds(others, m, r, given, tau, alpha):
            continue
        out = min(out or (e.log_e, number), (e.log_e, number))
    return None if out is None else out[1]


def _beside(others: State, f: Found, tau: float) -> tuple[Refined, Evidence, Metric]:
    assert f.term is not None
    r = Refined(f.term, f.columns, f.sizes, 0.0)
    m = leading_metric(others, [r])
    return r, spoken(m, f, tau), m


def _weighed_again(state: State, step: Step, tau: float) -> Step:
    at = place_of(state, step.term)
    if at is None or step.term.place.recording is not None:
        return step
    return replace(step, evidence=_beside(state.but(at), state.found[at], tau)[1])
