"""Presliding that a user sees in the error is an effect, and no nuisance.

How far dry friction gives way before it slips is free in every hypothesis, so that nothing is made up of a
reversal that is a little softer than a sign. Where that travel lowers the error of the joint's torque on the
rows that chose nothing, it is what the model lacks: there the model's own friction is held to turn over by
its rate alone, and the travel has to stand as an effect, like any other."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ident.diagnosis.state import State, settled

SEEN = 0.1  # of the error


def told_as_effects(state: State) -> State:
    """The state with the travel of those joints left to the search that the error asks for."""
    soft = [d.joint for d in state.problem.dry if d.joint in state.turns and state.turns[d.joint].travel > 0]
    if not soft:
        return state
    bare = _by_rate_alone(state, soft)
    seen = {j for j in soft if _error(state, j) < (1 - SEEN) * _error(bare, j)}
    return bare if seen == set(soft) else _by_rate_alone(state, seen) if seen else state


def _by_rate_alone(state: State, joints: Collection[int]) -> State:
    dry = tuple(replace(d, travels=d.travels and d.joint not in joints) for d in state.problem.dry)
    turns = {j: turn for j, turn in state.turns.items() if j not in joints}
    return settled(replace(state, problem=replace(state.problem, dry=dry), turns=turns), 2)


def _error(state: State, joint: int) -> float:
    """Of a joint's torques on the rows that judge [N m]."""
    own = [c for c, channel in enumerate(state.model.channels) if channel.joint == joint]
    told = [state.residual[c, state.rows.judged & state.rows.use[c]] for c in own]
    return float(np.sqrt(sum(np.sum(r**2) for r in told) / max(sum(len(r) for r in told), 1)))
