"""Effects whose size no fitted row shows: a load on a run that judges, another zero all along the only fitted
run. They are held in the last fit at the size that all rows gave (state.py); what is said of it is here."""

from __future__ import annotations

from ident.diagnosis.evidence.evidence import spread, whole
from ident.diagnosis.evidence.state import State, shown
from ident.diagnosis.extended.last_fit import is_told
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.settling import place_of
from ident.estimation.fit import FitResult


def own_deviations(state: State, term: Term) -> dict[str, float]:
    """Standard deviations of the parameters of what no fitted row shows, by the rows that do; {} of
    others."""
    number = place_of(state, term)
    if number is None or shown(state.rows, state.found[number].columns):
        return {}
    f, effect, place = state.found[number], term.effect, term.place
    known = spread(whole(state.but(number).metric, state.rows.usable), f.columns)
    values = {**term.theta, **dict(zip(effect.parameters_of(place), map(float, f.sizes)))}
    told = effect.report(values, known, effect.context_of(place, state.model), place)
    return {name: float(its["std"]) for name, its in told.items()}


def sized_by_judged(state: State, last: FitResult) -> list[str]:
    """A note for each effect that is told at a size which fitted rows alone do not show."""
    labels, out = state.problem.robot.joint_labels, []
    for f in state.found:
        if f.term is None or shown(state.rows, f.columns) or not is_told(last, f.term):
            continue
        joint = f.term.place.joint
        of = "" if joint is None else f" of joint {labels[joint]}"
        out.append(
            f"the size of {f.term.effect.name.replace('_', ' ')}{of} in {f.term.place.recording} is told by "
            "the runs that judge as well: their error with it is no prediction, that of a test run is"
        )
    return out
