"""A term of the loop as one of a study, and whether a fit of the study tells it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.state import State, shown
from ident.diagnosis.rows.terms import Term
from ident.equations.terms import Term as StudyTerm
from ident.estimation.fit import FitResult
from modelgen.effects.effect import Report


def study_term(term: Term, state: State) -> StudyTerm:
    """A term of the loop as one of a study, its sizes and shapes as starts. Sizes that the loop left out are
    held at zero: they read what is wrong elsewhere. (Beside 45 mrad of backlash a drop of -0.2 % was fitted,
    which is impossible; beside a coupling a dry friction that spoilt the runs that chose nothing.) What no
    fitted row shows, a load on a run that judges, is held as the loop has it, without what no motion of its
    place shows. (Of two joints no motion shows a body's mass: the study that held it at zero was refused, and
    0.77 kg were told to be something else.)"""
    found = next(f for f in state.found if f.term is term)
    known = {p.name for p in term.effect.linear}
    names, bounds = term.effect.parameters_of(term.place), term.effect.bounds(term.place)
    sizes = {name: float(x) for name, x in zip(names, found.sizes) if name in known}
    free = shown(state.rows, found.columns)
    others = {n for parts in term.effect.variants() for n in parts}
    others |= set() if free else {p.name for p in term.effect.linear if p.optional}
    left_out = dict.fromkeys(sorted(others - {*names}), 0.0)
    return StudyTerm(
        term.effect.name,
        term.effect,
        replace(term.place, parts=(*names, *left_out)),
        dict(term.theta),
        (*sizes.values(), *left_out.values()),
        tuple(bounds) if free else (),
        left_out if free else {**sizes, **left_out},
        bounds if free else {},
    )


def reported(state: State, number: int, covariance: np.ndarray | None = None) -> Report:
    """What an effect says of itself as the loop has found it; covariance (p, p) of its coefficients."""
    found = state.found[number]
    assert found.term is not None  # a function without a name reports nothing
    effect, place = found.term.effect, found.term.place
    values = {**found.term.theta, **dict(zip(effect.parameters_of(place), map(float, found.sizes)))}
    return effect.report(values, covariance, effect.context_of(place, state.model), place)


def is_told(fit: FitResult, term: Term) -> bool:
    return any(same(told, term) for told in fit.terms)


def same(a: StudyTerm, b: Term) -> bool:
    names = ("joint", "source", "side", "recording", "link")
    return a.effect.name == b.effect.name and all(
        getattr(a.place, n) == getattr(b.place, n) for n in names if getattr(b.place, n) is not None
    )
