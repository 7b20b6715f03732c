"""By how much an effect that acts on the model's own torque (a delay, a lag, a soft gear) is uncertain beyond
noise.

Its columns are approximations that grow worse with frequency, and how dry friction turns over looks alike
there: a covariance knows neither. So the extended study is fitted once more in the narrower band of the
study's own fit, and by as much as a value moves it is not known."""

from __future__ import annotations

from collections.abc import Mapping

from ident.diagnosis.evidence.state import State
from ident.diagnosis.extended.in_a_study import is_told, same
from ident.errors import FitFailedError, NotEnoughDataError, StudyError
from ident.estimation.fit import Examined, FitResult, fit_study
from ident.estimation.found_effects import found_effects

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
