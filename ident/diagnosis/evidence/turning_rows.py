"""Rows that see their joint turn round.

What friction does while a joint turns is known to a model's widths and no better, and what is wrong there
looks like a torque that comes at another time. A shift in time is a shift of all of the torque: it must show
where no joint turns, too."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial

import numpy as np
import scipy.linalg

from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.metric import Columns, Metric, beside_model, metric
from ident.diagnosis.evidence.refine import Refined
from ident.diagnosis.evidence.state import State
from ident.diagnosis.evidence.turned import turned
from ident.diagnosis.rows.unknown_turns import late_turns, unknown_turns
from ident.signals.dry_friction import TurnOver

WIDTHS = (0.5, 1.0, 2.0, 4.0)  # times that of a joint's turn-over
LITTLE = 0.25  # of what these rows hide of a law's other parts
TURNED = 0.99  # of the sign that friction takes: below it has not turned over yet


def without_turning(state: State, m: Metric, as_far_as_felt: bool = False) -> Metric:
    """The metric `m` on the rows of each channel in which its own joint keeps its direction, one row apart
    from those in which it does not; or so far that the filter of the rows passes a hundredth of a turn, and
    foretold from none of those left out. (In a hum whose noise remembers a second what turning rows had wrong
    was in all: a clean arm's torque was 1.4 ms late.)"""
    rows = state.rows
    beside = keeping_direction(state, as_far_as_felt)
    design, B = state.design
    whiteners = m.whiteners
    if as_far_as_felt:
        whiteners = tuple(w.seeing(use, rows.piece) for w, use in zip(m.whiteners, beside))
    return metric(replace(rows, use=beside), design, B, whiteners)


def beside_any_turn(
    state: State, m: Metric, late: float = 0.0, only: Collection[int] | None = None
) -> Metric:
    """The metric `m` beside a torque of each turn of a joint in its own channels, or in some of them `only`,
    of each of some widths: it may turn over there in any way; and at any time, where a torque is told to be
    so late [s]. (A clean arm whose encoder's steps are longer than its friction's travel was told to have a
    torque 20 ms late: every turn was, each by as much as its steps hid.)"""
    rows, (design, B) = state.rows, state.design
    whiteners = list(m.whiteners)
    for c in range(rows.channels) if only is None else only:
        j = state.model.channels[c].joint
        turn = state.turns.get(j, TurnOver())
        turns = [replace(turn, rate=k * turn.rate, travel=k * turn.travel) for k in WIDTHS]
        T = np.hstack([unknown_turns(state.segments, j, its) for its in turns])
        if late:
            T = np.hstack([T, late_turns(state.segments, j, late)])
        T *= rows.scale[c][:, None]
        whiteners[c] = whiteners[c].beside(T, (rows.fitted, rows.judged))
    return metric(rows, design, B, whiteners)


def apart_from_turns(state: State, m: Metric, columns: Columns, tau: float) -> bool:
    """Whether columns of size one say something on the rows that judge where joints keep their direction, or
    beside any torque of each turn: else they are what is not known of turns. (Of a clean arm, whose encoder's
    steps were as long as its friction's travel, a function of dq1 and what the joint remembers said 20 nats
    more; -4 where it kept its direction, -3 beside any turn.)"""
    asked = (make(state, m) for make in (without_turning, partial(beside_any_turn, only=columns)))
    return any(weigh(its, columns, np.ones(1)).log_e > tau for its in asked)


def keeping_direction(state: State, as_far_as_felt: bool = False) -> np.ndarray:
    """(C, M) the rows of each channel in which its own joint does, and one row apart from the others, or as
    far as the filter of the rows feels a turn."""
    out = []
    for c, use in enumerate(state.rows.use):
        j = state.model.channels[c].joint
        turning = [
            _turning(
                s.sign_dq[:, j], s.rows, s.every, -(-s.filter.transient // s.every) if as_far_as_felt else 1
            )
            for s in state.segments
        ]
        out.append(use & ~np.concatenate(turning))
    return np.array(out)


def turning_alone(state: State, m: Metric, r: Refined) -> bool:
    """Whether a law with several sizes has a direction of them that the model imitates while the joint keeps
    its direction: what turning joints say of it is an error of the turn-over. (Friction under load that
    differs by the direction of power is friction under load and a multiple of the load: 30 nats parted them,
    all of rows that turned, and for the wrong one.)"""
    if "sign_dq" not in r.term.effect.needs or r.term.effect.updates or len(r.sizes) < 2:
        return False
    white = m.whiten(r.columns)
    left = [beside_model(its, its.fitted, white)[0] for its in (m, without_turning(state, m))]
    scale = np.sqrt(np.maximum(np.diag(left[0]), 1e-300))
    whole, kept = (G / np.outer(scale, scale) for G in left)
    shares = scipy.linalg.eigvalsh(kept, whole + 1e-9 * np.eye(len(whole)))
    return bool(shares[0] < LITTLE * shares[-1])


def turned_as_judged(state: State, m: Metric, joint: int) -> Metric | None:
    """The metric `m` with a joint's dry friction turning over as the rows that judge want it; None where it
    has none, or these rows are not of recordings of their own: then its turn-over is that of all rows. A
    width is the model's own, free on both kinds of rows: what a law says beside one that another run had is
    an error of that. (Of two clean arms a Stribeck friction was told by 56 nats, 2.4 beside the judged run's
    own width, a friction under load by 23, -2.)"""
    rows = state.rows
    if not rows.held_apart or joint not in {d.joint for d in state.problem.dry}:
        return None
    as_fitted = replace(state, rows=replace(rows, fitted=rows.judged, judged=rows.fitted))
    its = turned(as_fitted, {joint}, joint)
    if its.turns == state.turns:
        return None
    design, B = its.design
    return metric(replace(its.rows, fitted=rows.fitted, judged=rows.judged), design, B, m.whiteners)


def _turning(sign: np.ndarray, rows: int, every: int, apart: int) -> np.ndarray:
    """(rows,) bool, of rows in which a joint turns and those within so many of them."""
    here = (np.abs(sign[: rows * every]) < TURNED).reshape(rows, every).any(axis=1)
    here |= np.diff(np.sign(sign[: rows * every : every]), prepend=np.sign(sign[:1])) != 0
    wide = here.copy()
    for k in range(1, min(apart, rows - 1) + 1):
        wide[k:] |= here[:-k]
        wide[:-k] |= here[k:]
    return wide
