"""Presliding that a user sees in the error is an effect, and no nuisance.

How far dry friction gives way before it slips is free in every hypothesis, so that nothing is made up of a
reversal that is a little softer than a sign. Where that travel lowers the error of the joint's torque on the
rows that chose nothing, and of those that are fitted, it is what the model lacks: there the model's own
friction is held to turn over by its rate alone, and the travel has to stand as an effect, like any other. (A
search finds nothing that fitted rows do not show: of an arm whose first joint turned in parts of its run that
judge alone an error far beyond noise was told.) A torque that comes late turns over late, too: where a shift
in time says as much as a travel, it stays a nuisance. So does a travel that is over before the samples can
show it: it is when a sign was sampled."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.settled import settled
from ident.diagnosis.evidence.state import State, solved
from ident.diagnosis.rows.signs import sign_column, sign_columns
from ident.diagnosis.rows.turn_over import Dry, grids, unseen_travel, with_column
from ident.signals.dry_friction import TurnOver
from modelgen.effects.effect import Effect
from modelgen.effects.place import Layout
from modelgen.effects.states import integrate_dahl

SEEN = 0.1  # of the error
LATE_S = tuple(sign * late for late in (0.003, 0.006, 0.01, 0.015, 0.02, 0.03, 0.04) for sign in (1, -1))


def told_as_effects(state: State, tau: float) -> State:
    """The state with the travel of those joints left to the search that the error asks for."""
    travels = {j: turn.travel for j, turn in state.turns.items()}
    hidden = {d.joint: unseen_travel(state.segments, d.joint) for d in state.problem.dry}
    soft = [joint for joint, least in hidden.items() if travels.get(joint, 0.0) > least]
    if not soft:
        return state
    bare = _by_rate_alone(state, soft)
    sides = (state.rows.judged, state.rows.fitted)
    seen = {j for j in soft if all(_error(state, j, on) < (1 - SEEN) * _error(bare, j, on) for on in sides)}
    seen -= {d.joint for d in state.problem.dry if d.joint in seen and not _has_a_name(bare, state, d, tau)}
    seen -= _late(bare, state, seen)
    return bare if seen == set(soft) else _by_rate_alone(state, seen) if seen else state


def shortest_travels(effects: Iterable[Effect], layout: Layout) -> dict[int, float]:
    """{joint: the shortest travel [rad | m] that an effect has which gives way as dry friction does}."""
    out: dict[int, float] = {}
    for effect in effects:
        if effect.state is None or effect.state.integrate is not integrate_dahl:
            continue
        for place in effect.places(layout):
            if place.joint is not None:
                low = min(low for low, _ in effect.bounds(place).values())
                out[place.joint] = min(out.get(place.joint, np.inf), low)
    return out


def _has_a_name(bare: State, state: State, dry: Dry, tau: float) -> bool:
    """Whether an effect can say it: its travel is one that effects have, or beside a sign one of theirs says
    as much on the rows that judge; within the limit there, on the fitted ones. (Of a UR10e's fourth joint 0.2
    mrad fit best, and 0.4 beside its sign better. Of a clean one in steps of 0.09 mrad 0.6 beside a sign was
    4 nats ahead of its 0.05, and 20 behind on the fitted rows: a hysteresis was told.)"""
    turn, m = state.turns[dry.joint], bare.metric
    if turn.travel > dry.shorter:
        return True
    widths = grids(bare.segments, dry.joint, dry.shorter)
    sharp = _sharp(turn, widths)
    longer = [replace(sharp, travel=float(w)) for w in widths["travel"] if w >= dry.shorter]
    own, *theirs = (
        weigh(m, {c: sign_columns(bare.segments, bare.rows, dry.joint, c, [its]) for c, _ in dry.places})
        for its in (turn, *longer)
    )
    most = max((e.log_e for e in theirs), default=-np.inf)
    if abs(most - own.log_e) > tau:
        return most > max(own.log_e, tau)
    return max(e.gain for e in theirs) >= own.gain


def _by_rate_alone(state: State, joints: Collection[int]) -> State:
    dry = tuple(replace(d, travels=d.travels and d.joint not in joints) for d in state.problem.dry)
    turns = {j: turn for j, turn in state.turns.items() if j not in joints}
    return settled(replace(state, problem=replace(state.problem, dry=dry), turns=turns), 2)


def _late(bare: State, state: State, joints: Collection[int]) -> set[int]:
    """Those whose torques a shift in time explains as well as the travel does, with a sharp sign."""
    rows = bare.rows
    sharp = {j: _sharp(bare.turns.get(j, TurnOver()), grids(state.segments, j)) for j in joints}
    for d in bare.problem.dry:
        if d.joint in joints:
            made = {c: sign_column(state.segments, rows, d.joint, c, sharp[d.joint]) for c, _ in d.places}
            rows = with_column(rows, d, made)
    out: set[int] = set()
    for seconds in LATE_S if joints else ():
        Y = np.stack([_earlier(state, c, seconds) for c in range(rows.channels)])
        trial = solved(replace(bare, rows=replace(rows, Y=Y)))
        judged = rows.judged
        out |= {j for j in joints if _error(trial, j, judged) <= _error(state, j, judged)}
    return out


def _sharp(turn: TurnOver, widths: Mapping[str, np.ndarray]) -> TurnOver:
    return replace(turn, rate=float(widths["rate"][0]), travel=0.0)


def _earlier(state: State, c: int, seconds: float) -> np.ndarray:
    """(M,) a channel's torque as it is recorded `seconds` later."""
    joint, parts = state.model.channels[c].joint, []
    for s in state.segments:
        taken = np.interp(s.t + seconds, s.t, s.measured[:, c])
        parts.append(s.decimate(taken[:, None], joint)[:, 0])
    return np.concatenate(parts) * state.rows.scale[c]


def _error(state: State, joint: int, on: np.ndarray) -> float:
    """Of a joint's torques on the rows `on` (M,) [N m]."""
    own = [c for c, channel in enumerate(state.model.channels) if channel.joint == joint]
    told = [state.residual[c, on & state.rows.use[c]] for c in own]
    return float(np.sqrt(sum(np.sum(r**2) for r in told) / max(sum(len(r) for r in told), 1)))
