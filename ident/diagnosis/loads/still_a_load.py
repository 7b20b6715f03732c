"""A load that was found before, asked again beside all that was found since."""

from __future__ import annotations

from ident.diagnosis.evidence.evidence import Evidence
from ident.diagnosis.evidence.leading import outside_metric
from ident.diagnosis.evidence.metric import Metric, acting, whole
from ident.diagnosis.evidence.refine import Refined, fit_sizes
from ident.diagnosis.evidence.state import Found, State
from ident.diagnosis.loads.between_runs import between_runs, comparable
from ident.diagnosis.loads.is_a_load import (
    as_one_number,
    by_what_it_needs,
    can_be,
    cross_evidence,
    halves_of,
    is_load,
)


def still_holds(state: State, f: Found, tau: float, alpha: float) -> bool:
    """state: without it, and with all that was found since."""
    assert f.term is not None
    runs = f.term.effect.windowed and comparable(state, f.term, f.columns)
    if runs and between_runs(state, f.term, f.columns, tau, tau) is not None:
        return True
    own = _own(state, f)
    sizes, _ = fit_sizes(whole(own, state.rows.usable), f.columns)
    if f.term.effect.windowed and not can_be(state, own, f.term, f.columns, sizes, tau):
        return False
    halves = halves_of(state, own, f.columns)
    evidence = cross_evidence(halves, f.columns, acting(f.columns))
    if f.term.effect.windowed and as_one_number(state, halves, f.term, f.columns, evidence, tau):
        return False
    if f.term.effect.windowed and not by_what_it_needs(halves, f.term, f.columns, evidence, tau, alpha):
        return False
    return is_load(state, halves, f.columns, evidence, tau, alpha)


def evidence_of(state: State, f: Found) -> Evidence:
    """What alternating blocks say of it; state: without it."""
    return cross_evidence(halves_of(state, _own(state, f), f.columns), f.columns, acting(f.columns))


def _own(state: State, f: Found) -> Metric:
    """The noise that it is judged in."""
    assert f.term is not None
    return outside_metric(state, Refined(f.term, f.columns, f.sizes, 0.0), acting(f.columns))
