"""Dry friction turning over as fits best beside everything found, in the torque as it is recorded."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.state import State, recolumned
from ident.diagnosis.rows.recorded import Record, comes_late, recorders
from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.rows.signs import sign_column
from ident.diagnosis.rows.steps import Stepped, multiplies_sign, steps
from ident.diagnosis.rows.turn_over import Dry, TurnOver, settle, with_column, with_turn_overs
from ident.equations.fine import FineSegment


def turned(state: State, afresh: Collection[int] = (), joint: int | None = None) -> State:
    """Dry friction turns over as fits best beside everything found; on the joints `afresh` sought in all its
    range: in a louder residual another width was best, and no small step leads from it to the right one.
    joint: that of this one alone."""
    p = state.problem
    dry = tuple(d for d in (*p.dry, *_found_dry(state)) if joint in (None, d.joint))
    if not dry:
        return state
    own = fitted_alone(state)
    design, B, record = _as_recorded(own, dry)
    design, stepped = _as_stepped(own, dry, design, record)
    turns = settle(
        own.rows, design, B, own.whiteners, own.segments, dry, state.turns, afresh, {**record, **stepped},
        kept=p.signs, motion=state.segments,
    )  # fmt: skip
    if turns == state.turns:
        return state
    changed = {j: turn for j, turn in turns.items() if turn != state.turns.get(j)}
    return recolumned(replace(turning_over(state, state.rows, state.segments, changed), turns=turns))


def turning_over(
    state: State, rows: Rows, segments: Sequence[FineSegment], turns: Mapping[int, TurnOver]
) -> State:
    """The state on these rows and signals, the joints in `turns` turning over so. (A joint that rests, or
    goes one way, turns over nowhere.)"""
    for d in state.problem.dry:
        if d.joint in turns:
            made = {c: sign_column(segments, rows, d.joint, c, turns[d.joint]) for c, _ in d.places}
            rows = with_column(rows, d, made)
    segments = with_turn_overs(segments, turns)
    motions = tuple(s.motion for s in segments)
    return replace(state, rows=rows, segments=segments, motions=motions)


def fitted_alone(state: State) -> State:
    """Of the recordings that are fitted alone, where that is all that is asked for."""
    rows = state.rows
    fitted = np.unique(rows.recording[rows.fitted])
    chosen = np.flatnonzero(np.isin(rows.recording, fitted))
    if len(chosen) == len(rows.t):
        return state
    mine = [k for k, s in enumerate(state.segments) if s.recording in fitted]
    found = (replace(f, columns={c: z[chosen] for c, z in f.columns.items()}) for f in state.found)
    return replace(
        state,
        rows=rows.only(chosen),
        segments=tuple(state.segments[k] for k in mine),
        motions=tuple(state.motions[k] for k in mine),
        whiteners=tuple(w.only(chosen) for w in state.whiteners),
        found=tuple(found),
    )


def _as_recorded(
    state: State, dry: Sequence[Dry]
) -> tuple[Sequence[tuple[np.ndarray, np.ndarray]], int, dict[tuple[int, int], Record]]:
    """The design with dry friction's columns as they are recorded, which the columns of what comes late have
    no more part in, and how each joint's sign is recorded in the channels that come late."""
    design, B = state.design
    record = recorders(state.terms, state.model.channels, state.motions)
    if not record:
        return design, B, {}
    late: dict[int, tuple[int, float]] = {}  # of each channel the first of what comes late: its place, size
    at = state.rows.b
    for f in state.found:
        if f.term is not None and f.term.size and f.term.size[0] and comes_late(f.term):  # at 0: not yet late
            late |= {c: (at, f.term.size[0]) for c in f.columns if c not in late}
        at += next(iter(f.columns.values())).shape[1]
    made = list(design)
    for d in dry:
        turn = state.turns.get(d.joint)
        for c, place in d.places:
            if turn is None or c not in late:
                continue
            places, values = made[c][0], made[c][1].copy()
            its, (where, size) = places == place, late[c]
            sign = sign_column(state.segments, state.rows, d.joint, c, turn, record.get(c))
            values[:, places == where] -= state.beta[place] * (sign[:, None] - values[:, its]) / size
            values[:, its] = sign[:, None]
            made[c] = places, values
    return made, B, {(d.joint, c): record[c] for d in dry for c, _ in d.places if c in record}


def _as_stepped(
    state: State,
    dry: Sequence[Dry],
    design: Sequence[tuple[np.ndarray, np.ndarray]],
    late: Mapping[tuple[int, int], Record],
) -> tuple[Sequence[tuple[np.ndarray, np.ndarray]], dict[tuple[int, int], Stepped]]:
    """The design with all that a joint's sign multiplies in the columns of its dry friction, as it is at the
    estimate, where effects were found that have a part in it; and what that is. (Not where it comes late.)"""
    made, out = list(design), dict[tuple[int, int], Stepped]()
    for d, c in dict.fromkeys((its, c) for its in dry for c, _ in its.places):
        turn, joint = state.turns.get(d.joint), state.model.channels[c].joint
        asked = [
            (number, f.term)
            for number, f in enumerate(state.found)
            if f.term is not None and c in f.columns and multiplies_sign(f.term, d.joint)
        ]
        if turn is None or not asked or (d.joint, c) in late:
            continue
        own = [place for channel, place in d.places if channel == c]
        heights = [np.full(len(s.t), float(state.beta[own].sum())) for s in state.segments]
        places, values = made[c][0], made[c][1].copy()
        for number, term in asked:
            model, taken = state.but(number).model, []
            for k, (segment, motion) in enumerate(zip(state.segments, state.motions)):
                step = steps(term, motion, model)[c]
                heights[k] += step @ state.found[number].sizes
                taken.append(segment.decimate(step * motion.sign_dq[:, [d.joint]], joint))
            own_places = state.coefficients(number)
            its = (places >= own_places.start) & (places < own_places.stop)
            values[:, its] -= np.concatenate(taken) * state.rows.scale[c][:, None]
        out[d.joint, c] = Stepped(heights)
        column = sign_column(state.segments, state.rows, d.joint, c, turn, out[d.joint, c])
        values[:, np.isin(places, own)] = column[:, None]
        made[c] = places, values
    return made, out


def _found_dry(state: State) -> tuple[Dry, ...]:
    """Dry friction that a study left out and that was found: it turns over as the model's own does."""
    out, at = [], state.rows.b
    for f in state.found:
        term, p = f.term, next(iter(f.columns.values())).shape[1]
        if term is not None and term.effect.replaces and term.effect.needs == {"sign_dq"}:
            out.append(Dry(int(term.place.joint or 0), tuple((c, at) for c in f.columns)))
        at += p
    return tuple(out)
