"""What a study left out of the model on several joints, asked of all of them at once.

Of a TX40 without viscous friction no joint's said enough: what the others lacked stood in their noise, and
dry friction turned over so slowly that it took its place; together they take the error from 44 to 6 %.
Who leaves a term out does so everywhere, so that this is one hypothesis; joints that do not ask for it beside
the others lose it again, as everything does that the judged rows do not ask for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.metric import side_by_side
from ident.diagnosis.evidence.refine import Refined, fit_sizes
from ident.diagnosis.evidence.settled import with_found
from ident.diagnosis.evidence.state import Found, State
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Library
from ident.diagnosis.search.settling import refined_together


def left_out(
    state: State, library: Library, tau: float
) -> tuple[State, tuple[tuple[Term, Evidence], ...]] | None:
    """The term that says most on several joints together, settled in, and what each joint's says beside the
    others. None: no such term is asked for by both kinds of rows."""
    known = {term.key for term in state.terms}
    groups: dict[str, list[Refined]] = {}
    for effect, place in library.places:
        term = Term(effect, place, {})
        if not effect.replaces or place.joint is None or term.key in known:
            continue
        columns = state.scene.columns(term)
        if columns:
            r = Refined(term, columns, *fit_sizes(state.metric, columns))
            groups.setdefault(effect.name, []).append(r)
    told = [_asked(state, group) for group in groups.values() if len(group) > 1]
    told = [(settled, e) for settled, e in told if e.log_e > tau and e.gain > tau]
    if not told:
        return None
    settled, _ = max(told, key=lambda its: its[1].log_e)
    fresh = [(k, f) for k, f in enumerate(settled.found) if f.term is not None and f.term.key not in known]
    return settled, tuple((f.term, weigh(settled.but(k).metric, f.columns)) for k, f in fresh if f.term)


def _asked(state: State, group: Sequence[Refined]) -> tuple[State, Evidence]:
    """The state with all of a group settled in, and what they say side by side in the noise that this leaves,
    their friction turning over as it does with them: beside a sign that turns at once, in a noise that was
    all of what is missing, an LWR4+'s Coulomb friction said 1 of 258 nats."""
    found = [Found(r.term, r.columns, r.sizes) for r in group]
    settled = refined_together(with_found(replace(state, turns={}), *found))
    keys = {r.term.key for r in group}
    theirs = [f for f in settled.found if f.term is not None and f.term.key in keys]
    others = replace(settled, found=tuple(f for f in settled.found if f not in theirs))
    return settled, weigh(others.metric, reduce(side_by_side, (f.columns for f in theirs)))
