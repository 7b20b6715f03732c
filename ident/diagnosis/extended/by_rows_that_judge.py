"""How well the rows that judge know what no fitted row shows: a load on a run that judges, another zero all
along the only fitted run. The last fit holds it at the size that all rows gave (state.py)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ident.diagnosis.evidence.metric import Metric, whole
from ident.diagnosis.evidence.state import State, shown
from ident.diagnosis.extended.in_a_study import is_told, reported
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.settling import place_of
from ident.estimation.blocks import by_stretches, stretch_s
from ident.estimation.fit import FitResult


def own_deviations(state: State, term: Term) -> dict[str, float]:
    """Standard deviations of the parameters of what no fitted row shows, by the rows that do; {} of
    others."""
    number = place_of(state, term)
    if number is None or shown(state.rows, state.found[number].columns):
        return {}
    told = reported(state, number, _known(state, number))
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


def _known(state: State, number: int) -> np.ndarray:
    """(p, p) covariance of its coefficients beside the model, by how far these move from stretch to stretch
    (blocks.py). (Half a kilogram at a rokae's flange, in the run that judges, was told as 0.565 +- 0.021.)"""
    m, own = whole(state.metric, state.rows.usable), state.coefficients(number)
    half = m.fitted.basis
    wider = by_stretches(half, _stretches(m), np.sum(half**2, axis=1))[own]
    return np.asarray((half[own] @ half[own].T) * np.outer(wider, wider))


def _stretches(m: Metric) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """(B,) X'e and (B, B) X'X of every stretch of the fitted rows."""
    rows, side = m.rows, m.fitted
    seconds = stretch_s(rows.hop * float(np.sum(side.mask)))
    stretch = rows.piece * 1_000_000 + np.floor(rows.t / seconds).astype(int)
    for k in np.unique(stretch[side.mask]):
        score, gram = np.zeros(m.B), np.zeros((m.B, m.B))
        for c, (places, values) in enumerate(m.X):
            on = side.mask & rows.use[c] & (stretch == k)
            score[places] += values[on].T @ side.residual[c, on]
            gram[np.ix_(places, places)] += values[on].T @ values[on]
        yield score, gram
