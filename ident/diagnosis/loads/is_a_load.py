"""Whether what looks like a load is one: beside the window's own friction, another joint's zero, all of the
model's parameters, and the loads that were found before.

Rows of an event are in one recording alone, so it is judged there: alternating blocks of all rows, each
predicted from the other half.

A model that is wrong elsewhere is wrong on one run in its own way, and a body's ten parameters take that up.
So a load has to hold beside the run's own friction (days differ), and all of the model's parameters, free in
that window, must not say more than it does (sufficiency: a load is among the changes that they can make)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.leading import outside_metric
from ident.diagnosis.evidence.metric import Columns, Metric, acting, side_by_side, side_of, spread, whole
from ident.diagnosis.evidence.refine import Refined, fit_sizes
from ident.diagnosis.evidence.state import State, solved
from ident.diagnosis.evidence.sufficiency import NEARLY
from ident.diagnosis.evidence.turning_rows import beside_any_turn, without_turning
from ident.diagnosis.loads.own_of_a_run import (
    is_zeros,
    numbers,
    one_number,
    own_columns,
    own_friction,
    says_as_much,
)
from ident.diagnosis.rows.terms import Term

FOLD_S, SHORTEST_FOLD_S = 1.0, 0.25  # s: blocks that predict each other
FOLDS = 12  # of a window, where it is short
SHORTEST_S = 1.5  # of a load


def crossed(m: Metric, usable: np.ndarray, fold_s: float) -> tuple[Metric, Metric]:
    """The same noise with alternating blocks fitted and judged, and the other way round."""
    rows = m.rows
    even = (np.floor(rows.t / fold_s).astype(int) + rows.recording) % 2 == 0
    sides = [side_of(rows, m.X, m.y, m.B, usable & half, False, m.taken) for half in (even, ~even)]
    return replace(m, fitted=sides[0], judged=sides[1]), replace(m, fitted=sides[1], judged=sides[0])


def halves_of(state: State, m: Metric, columns: Mapping[int, np.ndarray]) -> tuple[Metric, Metric]:
    """Alternating blocks of the usable rows, short enough that a dozen of them lie in the window."""
    fold = float(np.clip(acting(columns).sum() * state.rows.hop / FOLDS, SHORTEST_FOLD_S, FOLD_S))
    return crossed(m, state.rows.usable, fold)


def is_load(
    state: State,
    halves: tuple[Metric, Metric],
    columns: Columns,
    alone: Evidence,
    tau: float,
    alpha: float,
) -> bool:
    """It says something beside the window's own friction, or `alone` no less than that with fewer numbers;
    and all of the model's parameters say hardly more than it (NEARLY, as of any law: what its columns are
    wrong by grows with it), if only where all noise is white. (A contact of 4 N and 2 s on a UR10e says 1366
    nats, the friction of six drives 1317, both 1332: what these learn of it is their price.)"""
    inside = acting(columns)
    drives, nats = own_friction(state, inside, crosswise(halves, columns))
    friction = None if nats is None else cross_evidence(halves, drives, inside)
    beside = side_by_side(columns, drives)
    load = cross_evidence(halves, beside, inside)
    every = own_columns(state, inside, range(state.rows.b))
    whole = cross_evidence(halves, every, inside)
    simpler = friction is not None and alone.log_e >= friction.log_e and numbers(columns) < numbers(drives)
    best = max(alone, load, key=lambda its: its.log_e) if simpler else load
    more = load.log_e > tau if friction is None else simpler or load.beats(friction, tau, alpha)
    other = NEARLY * whole.log_e > best.log_e and whole.beats(best, tau, alpha)
    return more and (not other or as_plain_rows(state, columns, every))


def as_plain_rows(state: State, columns: Columns, every: Columns) -> bool:
    """Whether it says nearly as much (NEARLY) as all of the model's parameters where rows count as if their
    noise were white: whitened, slow torque counts little. (2 kg at an AIRBOT's flange, 40 times the noise:
    parameters that followed its fast part said 13 % more; in torque they leave a tenth more than it does.)"""
    halves = halves_of(state, whole(state.plain_metric, state.rows.usable), columns)
    load, most = (cross_evidence(halves, z, acting(columns)).log_e for z in (columns, every))
    return load > 0 and load >= NEARLY * most


def can_be(state: State, own: Metric, term: Term, columns: Columns, sizes: np.ndarray, tau: float) -> bool:
    """Whether physics allows a load, or one that all usable rows hold against it by less than tau nats."""
    names = term.effect.parameters_of(term.place)
    values = {**term.theta, **dict(zip(names, sizes))}
    known = spread(whole(own, state.rows.usable), columns)
    return term.effect.against(values, known, term.place, state.model) < tau


def by_what_it_needs(
    halves: tuple[Metric, Metric], term: Term, columns: Columns, evidence: Evidence, tau: float, alpha: float
) -> bool:
    """Whether a load says more than the parameters that it may leave out do by themselves. (Inertias below
    nothing took a fast joint's noise of the acceleration away for 0.8 s: a body of 0.03 kg was told.)"""
    rest = term.optional
    if not rest:
        return True
    beside = {c: z[:, rest] for c, z in columns.items()}
    return evidence.beats(cross_evidence(halves, beside, acting(columns)), tau, alpha)


def away_from_turns(state: State, own: Metric, columns: Columns, tau: float) -> bool:
    """Whether a load says something where the joints that it loads keep their direction, and beside any
    torque of each turn: what friction does while one turns is known to a model's widths and no better. (A
    second of creeping at twice a width was a body, by 43 nats, the start after a rest a force, by 3,080;
    neither was there.)"""
    asked = (make(state, own) for make in (without_turning, beside_any_turn))
    return all(fit_sizes(whole(its, state.rows.usable), columns)[1] > tau for its in asked)


def as_one_number(
    state: State, halves: tuple[Metric, Metric], term: Term, columns: Columns, evidence: Evidence, tau: float
) -> bool:
    """Of a load to the end of its recording: whether one joint whose position counts from another zero
    there, or whose torque has another factor, says as much by one number, or torques from other zeros do."""
    if term.place.stop is not None:
        return False
    inside, says = acting(columns), crosswise(halves, columns)
    if says_as_much(*one_number(state, term, inside), says, evidence.log_e, tau):
        return True
    return is_zeros(inside, state.rows.channels, numbers(columns), says, evidence.log_e, tau)


def stands_apart(state: State, own: Metric, term: Term, columns: Columns, tau: float) -> bool:
    """Of each load found that acts when this one does: it says something where that one does not act, or that
    one where this one does not. Two loads at one time are one that was not quite what it was told as. (Of a
    push on an AIRBOT that set in over 0.2 s, half a kilogram in the same two seconds was left.)"""
    ours = acting(columns)
    for number, f in enumerate(state.found):
        if f.term is None or not f.term.effect.windowed or f.term.place.recording != term.place.recording:
            continue
        theirs = acting(f.columns)
        if not (ours & theirs).any() or _says(state, own, columns, ~theirs, tau):
            continue
        others = solved(state.but(number))
        m = outside_metric(others, Refined(f.term, f.columns, f.sizes, 0.0), theirs)
        if not _says(others, m, f.columns, ~ours, tau):
            return False
    return True


def _says(state: State, m: Metric, columns: Columns, where: np.ndarray, tau: float) -> bool:
    """Whether a load says more than it would without the rows `where` (M,), if these are as many as a
    load's, at one size or each part at its own: told as one load where there are two, it fits neither. (Of
    bodies of 0.07 and 0.19 kg in turn, the first told as 0.09, the second was told as a force.)"""
    inside = acting(columns)
    if (inside & where).sum() * state.rows.hop < SHORTEST_S:
        return False
    halves = halves_of(state, m, columns)
    here, rest = ({c: z * on[:, None] for c, z in columns.items()} for on in (where, ~where))
    told = max(cross_evidence(halves, z, inside).log_e for z in (columns, side_by_side(here, rest)))
    return told > tau + max(0.0, cross_evidence(halves, rest, inside).log_e)


def crosswise(halves: tuple[Metric, Metric], columns: Columns) -> Callable[[Columns], float]:
    """Nats that others say where a load's columns act, either half foretold by the other."""
    inside = acting(columns)
    return lambda z: cross_evidence(halves, z, inside).log_e


def cross_evidence(
    halves: tuple[Metric, Metric], columns: Mapping[int, np.ndarray], inside: np.ndarray
) -> Evidence:
    """Both predictions together, judged by the blocks `inside`."""
    a, b = (weigh(m, columns, inside=inside) for m in halves)
    return Evidence(
        a.log_e + b.log_e,
        a.gain + b.gain,
        np.concatenate([a.blocks, b.blocks]),
        np.concatenate([a.expected, b.expected]),
        0.5 * (a.sizes + b.sizes),
        a.per_channel + b.per_channel,
        a.rss + b.rss,
        min(a.left, b.left),
        a.free + b.free,
    )
