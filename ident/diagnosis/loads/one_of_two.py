"""Two loads of other kinds whose windows overlap, told as one of them where that is enough.

Where a load begins and ends is searched in the noise of a model that lacks the others. An edge that came out
inside the load leaves the rest of it to be found, and of few seconds another kind says that as well. (Of a
force on a TX40's flange from 14.0 to 21.3 s the part from 16.9 s on was told, and before it a body of 0.05
kg from 14.7 to 18.1 s.)"""

from __future__ import annotations

import itertools
from dataclasses import replace

from ident.diagnosis.evidence.state import Found, State, solved
from ident.diagnosis.loads.events import what
from ident.diagnosis.loads.loads_in_turn import ahead, finite, in_their_windows, overlap, window
from ident.diagnosis.loads.still_a_load import evidence_of
from ident.diagnosis.outcome import Step
from ident.diagnosis.search.settling import refined_together


def one_of_two(state: State, steps: list[Step]) -> tuple[State, list[Step]]:
    """The state and its steps without loads whose rows another one explains as well, with its window where
    all rows want it, the numbers of either paid."""
    told = {s.term.key for s in steps}
    mine = [k for k, f in enumerate(state.found) if f.term is not None and f.term.key in told and _comes(f)]
    for a, b in itertools.permutations(mine, 2):
        trial = _without(state, a, b)
        if trial is None or ahead(state, trial) < 0:
            continue
        gone, kept = state.found[b].term, state.found[a].term
        assert gone is not None and kept is not None
        at = next(k for k, f in enumerate(trial.found) if f.term is not None and f.term.key == kept.key)
        term = trial.found[at].term
        assert term is not None
        step = Step(term, evidence_of(trial.but(at), trial.found[at]), ())
        rest = [step if s.term.key == kept.key else s for s in steps if s.term.key != gone.key]
        return one_of_two(trial, rest)
    return state, steps


def _comes(f: Found) -> bool:
    return f.term is not None and f.term.effect.windowed and not f.term.effect.all_along


def _without(state: State, kept: int, gone: int) -> State | None:
    """The state with one load in the windows of both; None where they are of a kind, or do not overlap."""
    one, other = state.found[kept].term, state.found[gone].term
    assert one is not None and other is not None
    windows = window(state, kept), window(state, gone)
    same = what(one) == what(other) or one.place.recording != other.place.recording
    if same or not overlap(windows):
        return None
    start, stop = finite(min(w[0] for w in windows)), finite(max(w[1] for w in windows))
    term = replace(one, place=replace(one.place, start=start, stop=stop))
    columns = state.scene.columns(term)
    if not columns:
        return None
    wide = state.swapped(kept, Found(term, columns, state.found[kept].sizes)).but(gone)
    return in_their_windows(refined_together(solved(wide)), {term.key})
