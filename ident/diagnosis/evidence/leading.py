"""The one noise in which the hypotheses of a step are compared, and that in which a load is judged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ident.diagnosis.evidence.metric import Columns, Metric, changed, metric, project
from ident.diagnosis.evidence.refine import Refined, fit_sizes
from ident.diagnosis.evidence.state import Found, State, solved
from ident.diagnosis.rows.whitened import Whitener, news, whitener

ENOUGH = 0.25  # of the rows, to know their noise by
OWN_COURSE = 5.0  # times what is new from row to row: what its past foretells to such a share is no noise


def leading_metric(state: State, refined: Sequence[Refined]) -> Metric:
    """The model's own columns, each channel in the least noise that any of the hypotheses leaves there:
    beside a hypothesis that is right, noise that has swallowed its effect would count against it."""
    usable = state.rows.usable
    least = list(state.whiteners)
    sizes = [_loudness(w, state.noise[c], state.rows.use[c] & usable) for c, w in enumerate(least)]
    for r in refined:
        trial = with_hypothesis(state, r)
        own = r.term.place.rows(state.model.channels)
        for c in own if r.term.place.joint is not None else r.columns:
            counted = state.rows.use[c] & usable
            w = whitener(state.rows, trial.noise[c], counted, state.rows.use[c])
            size = _loudness(w, trial.noise[c], counted)
            if size < sizes[c]:
                least[c], sizes[c] = w, size
    design, B = state.design
    return metric(state.rows, design, B, least)


def beside_function(state: State, c: int, column: np.ndarray, variables: tuple[str, ...]) -> Metric:
    """The model's own columns, channel c in the noise that a function (M,) without a name leaves on the rows
    that it was learned from: elsewhere it may foretell a fifth of what is there, and the rest would be noise.
    (A torque of sin q1 q6^2 was a tenth of a UR10e's first one, and "the model lacks nothing" was said.)"""
    trial = solved(state.plus(Found(None, {c: column[:, None]}, np.ones(1), variables)))
    use = state.rows.use[c]
    own = whitener(state.rows, trial.noise[c], use & state.rows.fitted, use)
    design, B = state.design
    return metric(state.rows, design, B, [own if k == c else w for k, w in enumerate(state.whiteners)])


def with_hypothesis(state: State, r: Refined) -> State:
    """The state with a hypothesis in it, as the fitted rows have both."""
    return solved(state.plus(Found(r.term, r.columns, r.sizes)))


def _loudness(w: Whitener, noise: np.ndarray, counted: np.ndarray) -> tuple[bool, float]:
    """Whether a hypothesis' own noise goes its own course, and the rms of what cannot be foretold of it, over
    all rows: a noise model is made of calm blocks, and the calm ones of a wrong model are those in which what
    it lacks is quiet. Noise that is noise comes before one that goes its own course: of a rotor that a model
    lacked an autoregression foretold 98 %, and what was left was the noise of the accelerations, smaller
    without that rotor than with it."""
    if not counted.any():
        return True, np.inf
    new = w.sigma * float(np.sqrt(np.mean((w @ noise)[counted] ** 2)))
    return float(np.sqrt(np.mean(noise[counted] ** 2))) > OWN_COURSE * new, new


def quiet(plain: Metric, columns: Columns) -> float:
    """How little of the residual cannot be foretold with these columns in the model, every channel by the
    noise that is left there: nats, but for a constant; plain: rows as if their noise were white."""
    side, rows, told = plain.fitted, plain.rows, 0.0
    white = plain.whiten(columns)
    sizes, _ = fit_sizes(plain, columns)
    after = changed(plain, side, white, sizes, project(plain, side, white)[0])
    for c in range(rows.channels):  # the model answers in all of them
        use = side.mask & rows.use[c]
        if use.any():
            told -= float(side.free[c]) / 2 * float(np.log(max(news(rows, after[c], use), 1e-300)))
    return told


def outside_metric(state: State, r: Refined, inside: np.ndarray) -> Metric:
    """The noise of all rows but those `inside` (M,), of the model with the hypothesis in it as the fitted
    rows have it: on the rows that judge it is what that model predicts wrongly. A load that says more than
    this is no weakness of a model that has seen too little."""
    usable = state.rows.usable
    trial = with_hypothesis(state, r)
    whiteners = []
    for c, use in enumerate(state.rows.use):
        rest = use & usable & ~inside
        here = rest if rest.sum() > ENOUGH * (use & usable).sum() else use & usable
        whiteners.append(whitener(state.rows, trial.residual[c], here, use))
    design, B = state.design
    return metric(state.rows, design, B, whiteners)
