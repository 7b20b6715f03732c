"""What was found, weighed again beside all that was found since."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence
from ident.diagnosis.evidence.given import given_fitted
from ident.diagnosis.evidence.refine import Refined
from ident.diagnosis.evidence.settled import with_found, without
from ident.diagnosis.evidence.state import Found, State, solved
from ident.diagnosis.evidence.sufficiency import short_of
from ident.diagnosis.loads.events import Event, best_event, others_of, what
from ident.diagnosis.loads.still_a_load import still_holds
from ident.diagnosis.outcome import Outcome, Step
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import SHARE, Library, Ranked, ranked
from ident.diagnosis.search.exchanged import shown_by_fitted
from ident.diagnosis.search.parameters_apart import spoken
from ident.diagnosis.search.settling import place_of, refined_together, whitened_squares
from ident.diagnosis.search.weighing import Weighed, compared, main_channel, rivals_of, simplest

FEW = 3  # of each metric


def reconsidered(
    state: State, steps: list[Step], library: Library, tau: float, alpha: float
) -> tuple[State, list[Step]]:
    """Each effect weighed again against what could have stood in its place, and what else as simple its joint
    may lack, beside all that was found since: what was missing then can have made one explanation look better
    than it is, or a simpler one too poor; loads against those of their recording. (Of a spring of an LWR4+'s
    third joint a crosstalk was told, the other one beside it: the spring had not been asked.)"""
    for number, f in enumerate(state.found):
        at = next((k for k, s in enumerate(steps) if f.term is not None and s.term.key == f.term.key), None)
        if f.term is None or at is None:
            continue
        if f.term.effect.windowed:
            event = _another_load(state, number, library, tau, alpha)
            if event is not None:
                r = event.refined
                steps[at] = Step(r.term, event.evidence, others_of(event))
                instead = state.swapped(number, Found(r.term, r.columns, r.sizes))
                state = refined_together(solved(instead))
            continue
        beside = {t.key: t for t in (*steps[at].passed, *(e.term for e in steps[at].equivalent))}
        others = state.but(number)
        beside = {t.key: t for t in _as_simple(others, library, f.term)} | beside
        if not set(beside) - {f.term.key}:
            continue
        trials = list({**beside, f.term.key: f.term}.values())
        weighed = compared(others, [Ranked(t, 0.0) for t in trials], tau, alpha)
        if not weighed.passed:
            continue
        best, evidence = simplest(weighed, tau)
        if _is_behind(weighed, best, evidence, f.term, tau, steps[at].evidence.given):
            continue
        c = main_channel(evidence, best.term, others)
        another = best.term.key != f.term.key
        if another and short_of(others, weighed.metric, best, evidence, c, tau) is not None:
            own = next((its for its in weighed.all if its[0].term.key == f.term.key), None)
            if own is None:
                continue
            best, evidence = own  # with what no law was told for, and may be there all the same
        rivals = rivals_of(weighed, best, evidence, tau, alpha)
        if best.term.key == f.term.key:
            steps[at] = replace(steps[at], equivalent=rivals)
            continue
        instead = state.swapped(number, Found(best.term, best.columns, best.sizes))
        trial = refined_together(solved(instead))
        if foretells_worse(trial, state, tau):
            continue
        state, steps[at] = trial, Step(best.term, evidence, rivals, steps[at].passed)
    return state, steps


def foretells_worse(trial: State, state: State, tau: float) -> bool:
    """Whether what was taken, or exchanged, foretells the judged rows worse, settled, by the limit than what
    was there, in the noise of either. (Of an AIRBOT at 50 Hz a gain of five in the place of a hysteresis,
    which said as much as it was, ended at 3e7 beside the rest, and a delay gave way to another hysteresis
    beside that. A ripple of a rokae's second joint, which the noise of the model without it had swallowed,
    lost 82 nats there, by a turn-over taken again, and took 9.2 % of the torque to 3.8.)"""
    noises = (
        (whitened_squares(noise, its, state.rows.judged) for its in (state, trial))
        for noise in (state, trial)
    )
    return all(after - before > 2 * tau for before, after in noises)


def _another_load(state: State, number: int, library: Library, tau: float, alpha: float) -> Event | None:
    """What is told of a load's recording in its place beside what was found since, if that is a load of
    another kind or on something else. (Of two bodies on two runs that were fitted the second was a force of
    its weight as long as the first was not in the model.)"""
    term = state.found[number].term
    if term is None or number == len(state.found) - 1:
        return None
    its = replace(library.layout, recordings=(str(term.place.recording),))
    event = best_event(state.but(number), library, tau, alpha, its)
    return event if event is not None and what(event.refined.term) != what(term) else None


def _as_simple(others: State, library: Library, term: Term) -> list[Term]:
    """What else the joint of a term may lack, of no more numbers than it, that explains most of the fitted
    rows; others: the state without it."""
    joint = term.place.joint
    if joint is None or term.effect.replaces or term.factor != 1.0 or term.effect.shifts_time:
        return []
    elsewhere = frozenset({j for _, place in library.places if (j := place.joint) is not None} - {joint})
    best: dict[tuple, Ranked] = {}
    for every in ranked(others, library, elsewhere):
        here = sorted((r for r in every.values() if r.term.place.joint == joint), key=lambda r: -r.gain)
        listed = [r for r in here if r.term.free <= term.free and r.gain > SHARE * here[0].gain]
        best |= {r.term.key: r for r in listed[:FEW]}
    return [r.term for r in best.values()]


def _is_behind(
    weighed: Weighed, best: Refined, evidence: Evidence, term: Term, tau: float, given: bool
) -> bool:
    """Whether what would stand in the place of a term says less than it by the limit: that the term's
    blocks do not agree any more is asked of it alone. (Of a rokae whose torques are all late one joint's 18
    nats stood in the place of all joints' 50.) given: as the term was told, by the judged rows given the
    fitted ones. (A Franka's spring, 300 nats so and 6 by the judged rows alone, gave way to a coupling that
    said a little there, and that to nothing.)"""
    m = weighed.metric

    def told(r: Refined, e: Evidence) -> float:
        return given_fitted(m, m.both, r.columns, e.sizes).of(e).log_e if given else e.log_e

    return any(told(r, e) - told(best, evidence) > tau for r, e in weighed.all if r.term.key == term.key)


def swapped(outcome: Outcome, at: int, term: Term) -> Outcome:
    """Another explanation in the place of a step's, settled beside the rest."""
    state, step = outcome.last, outcome.steps[at]
    number = place_of(state, step.term)
    others = state if number is None else state.but(number)
    columns = others.scene.columns(term)
    if number is None or not columns:
        return outcome
    state = refined_together(with_found(others, Found(term, columns, np.array(term.size or [1.0]))))
    if place_of(state, term) is None:
        return outcome
    return replace(outcome, last=state).with_step(at, replace(step, term=term))


def pruned(state: State, steps: list[Step], tau: float, alpha: float) -> tuple[State, list[Step]]:
    """Leave out, one after the other, what the judged rows do not ask for beside the rest."""
    while True:
        weak: tuple[float, int] | None = None
        for number, f in enumerate(state.found):
            if f.term is None:
                continue
            others = state.but(number)
            if f.term.place.recording is not None:
                if not still_holds(others, f, tau, alpha):
                    weak = (-np.inf, number)
                continue
            log_e = asked_for(others, f, tau)
            if log_e >= tau:
                continue
            if weak is None or log_e < weak[0]:
                weak = (log_e, number)
        if weak is None:
            return state, steps
        gone = state.found[weak[1]].term
        assert gone is not None
        steps = [s for s in steps if s.term.key != gone.key]
        state = without(state, weak[1])


def asked_for(others: State, f: Found, tau: float) -> float:
    """log E of what was found on the judged rows of a state without it; infinite where these cannot show it
    and the fitted ones beside them ask for it."""
    log_e = spoken(others.metric, f, tau).log_e
    return np.inf if log_e < tau and shown_by_fitted(others, f.columns, f.sizes, tau) else log_e
