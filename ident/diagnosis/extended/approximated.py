"""By how much the parameters of an effect are uncertain beyond noise.

Those of an effect that acts on the model's own torque (a delay, a lag, a soft gear): its columns are
approximations that grow worse with frequency, and how dry friction turns over looks alike there. A covariance
knows neither, so the extended study is fitted once more in the narrower band of the study's own fit, and by
as much as a value moves it is not known.

Those of any effect: the loop has found it too, on rows whose slow errors are foretold from those before,
beside functions of what no effect explains. What is left unexplained, and rows on end that are wrong alike,
move the last fit and not the loop, or the other way round; a covariance knows neither. (Of Dahl's friction in
two arms that MuJoCo moved from point to point the last fit was off by 4 to 7 of its deviations where a joint
came to rest, the loop by less than one.)"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ident.diagnosis.evidence.state import State
from ident.diagnosis.extended.in_a_study import is_told, reported, same
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.settling import place_of
from ident.errors import FitFailedError, NotEnoughDataError, StudyError
from ident.estimation.fit import Examined, FitResult, fit_study
from ident.estimation.found_effects import FoundEffect, found_effects

NOTHING: Mapping[str, float] = MappingProxyType({})
Moved = Mapping[tuple, Mapping[str, float]]  # of a hypothesis' key: by how much each parameter moves


def moved(known: Examined, state: State, base: FitResult, last: FitResult) -> Moved:
    """Nothing where the last fit holds no such effect, or was made in the same band."""
    read = [term for term in state.terms if term.size is not None and is_told(last, term)]
    if not read or last.cutoff_hz <= base.cutoff_hz:
        return {}
    band = last.study.filter.model_copy(update={"decimation_cutoff_hz": base.cutoff_hz})
    study = last.study.with_(filter=band)
    try:
        narrow = fit_study(study, known=known.again(study))
    except (FitFailedError, NotEnoughDataError, StudyError):
        return {}
    out = {}
    for here, there in zip(found_effects(last), found_effects(narrow)):
        term = next((t for t in read if same(here.term, t)), None)
        if term is not None:
            values = here.parameters.items()
            out[term.key] = {name: abs(p.value - there.parameters[name].value) for name, p in values}
    return out


def deviations(
    found: FoundEffect,
    own: Mapping[str, float],
    moves: Mapping[str, float],
    differ: Mapping[str, float] = NOTHING,
) -> dict[str, float]:
    """{parameter: deviation that is told with it}: its own, and by how much it moves with the band, and no
    less than two fits differ by (`apart`); none of a value that was given, or whose search ended at a bound.
    (Of three arms that MuJoCo moved torques were told to be 0.3 to 0.6 ms late, +- 0.3 to 0.5: what their
    bands differed by had not been asked.)"""
    plain = {name: p.std for name, p in found.parameters.items()} | dict(own)
    return {
        name: max(float(np.hypot(std, moves.get(name, 0.0))), differ.get(name, 0.0))
        for name, std in plain.items()
        if std
    }


def apart(state: State, term: Term, fitted: FoundEffect) -> dict[str, float]:
    """By how much each parameter of an effect as the last fit has it differs from what the loop found."""
    number = place_of(state, term)
    if number is None:
        return {}
    found = reported(state, number)
    turned = {quantity.name for quantity in term.effect.quantities if quantity.angle}
    out = {}
    for name in fitted.parameters.keys() & found.keys():
        off = fitted.parameters[name].value - float(found[name]["value"])
        out[name] = abs(float(np.angle(np.exp(1j * off)))) if name in turned else abs(off)
    return out
