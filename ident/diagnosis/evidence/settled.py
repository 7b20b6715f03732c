"""The model settled on the fitted rows. What waits for each other is taken in turn: least squares in the
noise at hand; the noise of what is left; the turn-over that fits best in that noise; columns that read the
model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.state import Found, Problem, State, recolumned, solved
from ident.diagnosis.evidence.turned import turned, turning_over
from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.rows.whitened import Whitener, whiteners
from ident.equations.fine import FineSegment
from ident.equations.terms import late_by

QUIETER = 0.9  # of what was new from row to row: dry friction is sought in all its range again
ROUNDS, CHANGE = 8, 1e-3  # of the residual, from which on columns that read the model stay as they are


def first_state(problem: Problem, rows: Rows, segments: Sequence[FineSegment]) -> State:
    plain = tuple(Whitener.white(use) for use in rows.use)
    motions = tuple(s.motion for s in segments)
    state = State(problem, rows, tuple(segments), motions, {}, (), plain, np.zeros(rows.b))
    return settled(state, 3)


def settled(state: State, rounds: int = 2) -> State:
    """Estimate, noise and turn-over in turn."""
    for _ in range(rounds):
        state = solved(state)
        before = state.whiteners
        state = replace(state, whiteners=whiteners(state.rows, state.noise, state.rows.usable))
        quieter = [w.sigma < QUIETER * old.sigma for w, old in zip(state.whiteners, before)]
        state = turned(state, {state.model.channels[c].joint for c in np.flatnonzero(quieter)})
    return solved(state)


def converged(state: State) -> State:
    """Columns that read the model, and the model beside them, taken in turn until neither changes."""
    for _ in range(ROUNDS):
        before, state = state.residual, solved(recolumned(state))
        if np.linalg.norm(state.residual - before) < CHANGE * np.linalg.norm(state.residual):
            break
    return state


def as_late_rows(state: State) -> State:
    """The state on rows without the samples whose sign a torque as late as it was found does not tell
    (signals/filtering.py); itself where they are left out already."""
    p = state.problem
    source = None if p.source is None else p.source.with_late(late_by(p.columns, state.terms))
    if source is None or source is p.source:
        return state
    rows, segments = source.read()
    if len(rows.t) != len(state.rows.t):  # a stretch is too short to be filtered with so much beside it
        return state
    state = replace(state, problem=replace(p, source=source))
    state = converged(turning_over(state, rows, segments, state.turns))
    return solved(replace(state, whiteners=whiteners(state.rows, state.noise, state.rows.usable)))


def with_found(state: State, *found: Found) -> State:
    """The state with more in it, settled again."""
    return settled(state.plus(*found), 1)


def without(state: State, number: int) -> State:
    """The state with one thing less, settled again."""
    return settled(state.but(number), 1)
