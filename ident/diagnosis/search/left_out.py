"""What a study left out of the model on several joints, asked of all of them at once.

Of a TX40 without viscous friction no joint's said enough: what the others lacked stood in their noise, and
dry friction turned over so slowly that it took its place; together they take the error from 44 to 6 %.
Who leaves a term out does so everywhere, so that this is one hypothesis; joints that do not ask for it beside
the others lose it again, as everything does that the judged rows do not ask for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.refine import Refined, fit_sizes
from ident.diagnosis.evidence.state import Found, State, with_found
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
    told = [(group, _together(state, group)) for group in groups.values() if len(group) > 1]
    told = [(group, e) for group, e in told if e.log_e > tau and e.gain > tau]
    if not told:
        return None
    group, _ = max(told, key=lambda its: its[1].log_e)
    found = [Found(r.term, r.columns, r.sizes) for r in group]
    settled = refined_together(with_found(replace(state, turns={}), *found))
    keys = {r.term.key for r in group}
    out = []
    for number, f in enumerate(settled.found):
        if f.term is not None and f.term.key in keys:
            out.append((f.term, weigh(settled.but(number).metric, f.columns)))
    return settled, tuple(out)


def _together(state: State, group: list[Refined]) -> Evidence:
    """What the joints' columns say side by side."""
    width = sum(len(r.sizes) for r in group)
    columns: dict[int, np.ndarray] = {}
    at = 0
    for r in group:
        for c, z in r.columns.items():
            columns.setdefault(c, np.zeros((len(state.rows.t), width)))[:, at : at + z.shape[1]] = z
        at += len(r.sizes)
    return weigh(state.metric, columns)
