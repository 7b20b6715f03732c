"""Loads on one recording whose windows overlap, told as loads of one kind in turn.

A search for one window at a time takes two loads in turn for one that lasts as long as both, and then for
others that take away from it what was too much. The same torques are those of loads that follow each other,
from edge to edge of all these windows. Where such as hold say as much of all rows, the numbers of either paid
(chosen at the price of half a logarithm of the rows each), they are what is told. Nor are two kinds told
where one is enough: an edge that came out inside a load, in the noise of a model that lacked the others, left
the rest of it to be found, and of few seconds another kind says that as well. (Of a force on a TX40's flange
from 14.0 to 21.3 s the part from 16.9 s on was told, and before it a body of 0.05 kg; of two bodies on an
LWR4+ one of what both weigh, from the first on, and a force that held it up until the second came.)"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.metric import whole
from ident.diagnosis.evidence.state import Found, State, solved
from ident.diagnosis.loads.edges import edged
from ident.diagnosis.loads.events import chosen, sized, what
from ident.diagnosis.loads.is_a_load import SHORTEST_FOLD_S
from ident.diagnosis.loads.still_a_load import evidence_of, still_holds
from ident.diagnosis.outcome import Step
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.settling import refined_together, whitened_squares

Window = tuple[float, float]  # [s]; infinite where the recording begins or ends


def in_turn(state: State, steps: list[Step], tau: float, alpha: float) -> tuple[State, list[Step]]:
    """The state and its steps with loads that follow each other in the place of those that overlap: of those
    of one kind, then of what overlaps at all, as loads of any of its kinds."""
    for alike in (True, False):
        for group in _overlapping(state, {s.term.key for s in steps}, alike):
            kinds = {what(t): t for t in group}.values()
            if alike or len(kinds) > 1:
                state, steps = _told_in_turn(state, steps, group, tuple(kinds), tau, alpha)
    return state, steps


def _told_in_turn(
    state: State, steps: list[Step], group: Sequence[Term], kinds: Sequence[Term], tau: float, alpha: float
) -> tuple[State, list[Step]]:
    """Loads of the one of some kinds that says most in the place of a group, if all rows are for them."""
    gone = {t.key for t in group}
    trials = [its for kind in kinds if (its := _following(state, gone, kind, tau, alpha))[1]]
    told = [(_ahead(state, trial), trial, mine) for trial, mine in trials]
    ahead, trial, mine = max(told, key=lambda its: its[0], default=(-np.inf, state, gone))
    if ahead < 0:
        return state, steps
    new = [(k, f.term, f) for k, f in enumerate(trial.found) if f.term is not None and f.term.key in mine]
    at = min(k for k, s in enumerate(steps) if s.term.key in gone)
    those = [Step(term, evidence_of(trial.but(k), f), ()) for k, term, f in new]
    before, after = ([s for s in its if s.term.key not in gone] for its in (steps[:at], steps[at:]))
    return trial, [*before, *those, *after]


def _following(
    state: State, gone: set[tuple], kind: Term, tau: float, alpha: float
) -> tuple[State, set[tuple]]:
    """The state with those of a load that hold from edge to edge of others, and their keys."""
    trial, mine = _apart(state, [k for k, f in enumerate(state.found) if f.term and f.term.key in gone], kind)
    before = None
    while mine and before != trial.terms:  # what does not hold leaves its rows to the others
        joined = _joined(_moved(trial, mine), mine)
        trial, before = _held(joined, mine, tau, alpha), joined.terms
        mine = mine & {t.key for t in trial.terms}
    return trial, mine


def _overlapping(state: State, told: set[tuple], alike: bool) -> list[list[Term]]:
    """Loads on one recording, each of which overlaps another one or is linked to it by such, of one kind or
    of any; those alone that are `told`: what the study declares is the user's."""
    by: dict[tuple, list[tuple[Window, Term]]] = {}
    for k, f in enumerate(state.found):
        if f.term is None or f.term.key not in told:
            continue
        if f.term.effect.windowed and not f.term.effect.all_along:
            which = (f.term.place.recording, *(what(f.term) if alike else ()))
            by.setdefault(which, []).append((_window(state, k), f.term))
    groups: list[list[Term]] = []
    for its in by.values():
        last = -np.inf
        for (begin, end), term in sorted(its, key=lambda one: one[0]):
            if begin < last - SHORTEST_FOLD_S:
                groups[-1].append(term)
            else:
                groups.append([term])
            last = max(last, end)
    return [group for group in groups if len(group) > 1]


def _window(state: State, number: int) -> Window:
    place = state.found[number].term.place  # type: ignore[union-attr]
    start, stop = place.start, place.stop
    return -np.inf if start is None else start, np.inf if stop is None else stop


def _apart(state: State, group: Sequence[int], first: Term) -> tuple[State, set[tuple]]:
    """The state with a load from each edge of the group's windows to the next, and their keys."""
    others = state
    for number in sorted(group, reverse=True):
        others = others.but(number)
    windows = [_window(state, k) for k in group]
    edges = [min(w[0] for w in windows)]
    for edge in sorted({edge for w in windows for edge in w}):
        if edge - edges[-1] > SHORTEST_FOLD_S:
            edges.append(edge)
    keys: set[tuple] = set()
    found = []
    for a, b in itertools.pairwise(edges):
        if not any(w[0] < b - SHORTEST_FOLD_S and a + SHORTEST_FOLD_S < w[1] for w in windows):
            continue
        place = replace(first.place, start=None if a == -np.inf else a, stop=None if b == np.inf else b)
        term = replace(first, place=place, copy=0).beside(keys | {t.key for t in others.terms})
        columns = others.scene.columns(term)
        if columns:
            keys.add(term.key)
            found.append(Found(term, columns, np.zeros(next(iter(columns.values())).shape[1])))
    return refined_together(solved(others.plus(*found))), keys


def _held(trial: State, keys: set[tuple], tau: float, alpha: float) -> State:
    """Without those of the loads that do not hold beside the others."""
    while True:
        mine = [k for k, f in enumerate(trial.found) if f.term is not None and f.term.key in keys]
        weak = [k for k in mine if not still_holds(trial.but(k), trial.found[k], tau, alpha)]
        if not weak:
            return trial
        least = min(weak, key=lambda k: float(np.abs(trial.found[k].sizes).sum()))
        trial = refined_together(trial.but(least))


def _moved(trial: State, mine: set[tuple]) -> State:
    """Each load's window where all rows want it, beside the others."""
    for k, f in enumerate(trial.found):
        if f.term is not None and f.term.key in mine:
            others = solved(trial.but(k))
            m = whole(others.metric, others.rows.usable)
            r = edged(m, others, sized(m, f.term, others.scene.columns(f.term), others))
            trial = solved(trial.swapped(k, Found(r.term, r.columns, r.sizes)))
    return refined_together(trial)


def _joined(trial: State, mine: set[tuple]) -> State:
    """Two loads of which one begins where the other ends as one, where that says as much."""
    windows = {k: _window(trial, k) for k, f in enumerate(trial.found) if f.term and f.term.key in mine}
    for a, b in itertools.permutations(windows, 2):
        if abs(windows[a][1] - windows[b][0]) > SHORTEST_FOLD_S:
            continue
        first, last = trial.found[a].term, trial.found[b].term
        assert first is not None and last is not None
        term = replace(first, place=replace(first.place, stop=last.place.stop))
        columns = trial.scene.columns(term)
        one = trial.swapped(a, Found(term, columns, trial.found[a].sizes)).but(b)
        one = _moved(refined_together(solved(one)), {term.key})
        if _ahead(trial, one) > 0:
            return _joined(one, mine)
    return trial


def _ahead(state: State, trial: State) -> float:
    """Nats by which all rows speak for the trial, in the noise of the state, the numbers of both paid."""
    usable = state.rows.usable
    before, after = (whitened_squares(state, s, usable) for s in (state, trial))
    fewer, more = (sum(chosen(t) for t in s.terms if t.effect.windowed) for s in (state, trial))
    return 0.5 * float(before - after - np.log(float(usable.sum())) * (more - fewer))
