"""Explanations that could not be told apart, or stood in another's place, compared by their last fits."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.state import State
from ident.diagnosis.extended.in_a_study import is_told
from ident.diagnosis.extended.last_fit import Refused, extended
from ident.diagnosis.left_over import leftovers
from ident.diagnosis.outcome import Outcome
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.parameters_apart import beside_changes
from ident.diagnosis.search.settling import place_of
from ident.diagnosis.search.weighing import Equivalent, simplicity
from ident.diagnosis.weighed_again import swapped
from ident.equations.observation import RecordingSystem, stack
from ident.estimation.fit import Examined, FitResult
from ident.estimation.least_squares import joint_sigma, rows_left, weighted_least_squares
from ident.progress import silent


def replaced(
    known: Examined,
    outcome: Outcome,
    base: FitResult,
    last: FitResult,
    refused: Refused,
    alpha: float,
) -> tuple[Outcome, FitResult, Refused]:
    """In the place of what the last fit could not be made of, what was as likely in the loop, or the simpler
    one that it contains, which that fit can be made of: what is left is then asked anew. (Of an arm with
    Dahl's friction a Maxwell slip, 1,612 nats for 1,589, had a negative element in the last fit, and no
    effect of the catalogue had that shape.)"""
    anew = False
    for at, step in enumerate(outcome.steps):
        if step.term.key not in refused:
            continue
        alike = {e.term.key: e.term for e in step.equivalent}
        simpler = {t.key: t for t in step.passed if step.term.contains(t)}
        for term in (alike | simpler).values():
            other = swapped(outcome, at, term)
            if other is outcome:
                continue
            fit, still = extended(known, other, base, alpha, silent)
            if is_told(fit, term):
                left = tuple(e for e in step.equivalent if e.term.key != term.key)
                outcome = other.with_step(at, replace(other.steps[at], equivalent=left))
                last, refused = fit, still
                anew |= term.key not in alike
                break
    rest = _asked_anew(outcome, alpha) if anew else outcome
    if len(rest.steps) < len(outcome.steps):  # what does not stand beside what is left goes out of the fit
        last, refused = extended(known, rest, base, alpha, silent)
    return rest, last, refused


def _asked_anew(outcome: Outcome, alpha: float) -> Outcome:
    """With what functions explain beside what stands now in another one's place."""
    first = [u for u in outcome.unnamed if u.nearest is not None]  # asked for; the others were left over
    state, steps, left = leftovers(outcome.last, list(outcome.steps), first, outcome.tau, alpha)
    return replace(outcome, last=state, steps=tuple(steps), unnamed=(*first, *left))


def compared_exactly(
    known: Examined, outcome: Outcome, base: FitResult, last: FitResult, refused: Refused, alpha: float
) -> tuple[Outcome, FitResult, Refused]:
    """Explanations that act on the model's own torque (a delay, a lag, a soft gear) compared by their last
    fits: in the loop their columns are made with the model that stood beside them, which favours the one
    that it was settled with. Those that the best one on the rows that chose nothing is not ahead of by the
    limit cannot be told apart: the simplest is told, and the others beside it."""
    for at, step in enumerate(outcome.steps):
        there = {t.key for t in outcome.last.terms}
        rivals = [t for t in step.passed if t.size is not None and t.key not in there]
        if step.term.size is None or not rivals or not is_told(last, step.term):
            continue
        tried = [(outcome, last, refused)]
        for rival in rivals:
            other = swapped(outcome, at, rival)
            if other is outcome:
                continue
            fit, still = extended(known, other, base, alpha, silent)
            if is_told(fit, rival):
                tried.append((other, fit, still))
        terms = [other.steps[at].term for other, _, _ in tried]
        places = {tuple(t.place.rows(outcome.last.model.channels)) for t in terms}
        own_rows = places.pop() if len(places) == 1 else ()  # in different channels: all answer
        fits = _beside_the_same(known, [(other, fit) for other, fit, _ in tried], at, base, alpha)
        nats = [_nats(outcome.last, fit, own_rows) for fit in fits]
        limit = outcome.tau * _overdispersion(outcome, step.term)
        equal = [k for k, n in enumerate(nats) if n > max(nats) - limit]
        best = min(equal, key=lambda k: (*simplicity(terms[k]), -nats[k]))
        own = step.evidence.log_e
        told = tuple(Equivalent(terms[k], own + nats[k] - nats[best]) for k in equal if k != best)
        keys = {term.key for term in terms}
        others = tuple(e for e in step.equivalent if e.term.key not in keys)
        outcome, last, refused = tried[best]
        outcome = outcome.with_step(at, replace(outcome.steps[at], equivalent=(*told, *others)))
        outcome = _left_anew(outcome, alpha) if best else outcome
    return outcome, last, refused


def _left_anew(outcome: Outcome, alpha: float) -> Outcome:
    """Without what functions explained beside another explanation, and explain no more beside this one."""
    if all(u.nearest is not None for u in outcome.unnamed):  # nothing was left over
        return outcome
    there = {u.channel for u in _asked_anew(outcome, alpha).unnamed}
    return replace(outcome, unnamed=tuple(u for u in outcome.unnamed if u.channel in there))


def _beside_the_same(
    known: Examined, tried: Sequence[tuple[Outcome, FitResult]], at: int, base: FitResult, alpha: float
) -> list[FitResult]:
    """The fits of several explanations of a step, each beside those effects only that all of them are told
    with: what one is ahead by because more stands beside it speaks not for it. (Of a UR10e's joint 2, 20 ms
    late, a lag was ahead by the hysteresis of 7 +- 3 N m that the delay's fit was not told with.)"""
    out = []
    for outcome, fit in tried:
        own = outcome.steps[at].term
        beside = [t for t in outcome.last.terms if t.key != own.key and is_told(fit, t)]
        extra = {t.key for t in beside if not all(is_told(other, t) for _, other in tried)}
        if extra:
            found = tuple(f for f in outcome.last.found if f.term is None or f.term.key not in extra)
            fewer = replace(outcome, last=replace(outcome.last, found=found))
            again, _ = extended(known, fewer, base, alpha, silent)
            fit = again if is_told(again, own) else fit
        out.append(fit)
    return out


def _overdispersion(outcome: Outcome, term: Term) -> float:
    """How many times too large noise is, where a term acts."""
    number = place_of(outcome.last, term)
    if number is None:
        return 1.0
    changes = beside_changes(outcome.last.but(number), outcome.last.found[number], outcome.tau)
    return 1.0 if changes is None else changes.kappa


def _nats(state: State, fit: FitResult, own: Collection[int]) -> float:
    """What the runs that chose nothing say given the fitted ones, each row as much as it is news in the
    state's noise; of the channels that the explanation acts in, or all. The fit's parameters are free in
    both, so that what the fitted runs leave open counts for nothing. (Of a rokae whose torques are all late
    the first one was told: parameters of seven seconds predict the next ones wrongly by 3 to 58 %, whatever
    is late.)"""
    fitted = [system for system in fit.systems if system.role == "identify"]
    every = [*fitted, *(system for system in fit.systems if system.role == "validate")]
    told = _likelihood(fit, every)
    if len(every) > len(fitted):
        told = told - _likelihood(fit, fitted)
    rows = np.array([max(factor.rows, 1) for factor in stack(every)])
    news = (state.rows.use & state.rows.usable).sum(axis=1) * [w.news for w in state.whiteners]
    told = told * np.minimum(news / rows, 1.0)
    return float(told[list(own)].sum() if own else told.sum())


def _likelihood(fit: FitResult, systems: Sequence[RecordingSystem]) -> np.ndarray:
    """(channels,) its logarithm, but for a constant, of the rows of some recordings, the parameters free."""
    factors, full = stack(systems), fit.full
    its = weighted_least_squares(factors, full.sigma, full.parameters, full.active, full.held)
    free = rows_left(factors, its.covariance, full.sigma)
    return np.asarray(-free * np.log(joint_sigma(factors, its.chi, its.covariance, full.sigma)))
