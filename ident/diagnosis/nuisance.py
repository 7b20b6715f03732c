"""What a candidate must not be credited with: columns that go along with it and are not the effect.

A late torque is judged beside friction signs that are free to turn over at once, a tilted base beside the
moments of the first joint that gravity did not show before.
"""

from dataclasses import replace

import numpy as np

from ident.diagnosis.candidates import Ranked, screen_columns
from ident.diagnosis.scoring import Columns, Score
from ident.diagnosis.settling import LATE
from ident.diagnosis.state import State
from ident.diagnosis.terms import Term, columns


def score_beside_nuisance(term: Term, cols: Columns, state: State) -> Score:
    """The exact score; of a late torque beside free friction signs, less what these gain alone; of a tilted
    base less what the moments gain that gravity did not show before."""
    system, equal = state.system, np.ones(len(state.system.y))
    plain = system.score(cols, share=equal)
    moments = beyond_terms(term, cols)
    if moments:
        alone = system.score(moments, share=equal)
        return replace(
            plain, identify=plain.identify - alone.identify, held_out=plain.held_out - alone.held_out
        )
    signs = sign_columns(term, state) if term.effect.name in LATE else {}
    if not signs:
        return plain
    both = system.score({c: np.hstack([cols[c], signs[c]]) for c in cols}, share=equal)
    alone = system.score(signs, share=equal)
    free = replace(
        both,
        identify=both.identify - alone.identify,
        held_out=both.held_out - alone.held_out,
        coefficients=both.coefficients[: len(plain.coefficients)],
    )
    return free if free.total > plain.total else plain


def with_free_signs(ranked: Ranked, state: State) -> Ranked:
    """The linear screen of a late torque beside free friction signs; other terms as they are."""
    term = ranked.term
    if term.effect.name not in LATE:
        return ranked
    system, signs = state.system, sign_columns(term, state)
    if not signs:
        return ranked
    cols = columns(term, state.context)
    both = screen_columns(term, {c: np.hstack([cols[c], signs[c]]) for c in cols}, system)
    return replace(ranked, gain=max(ranked.gain, both.gain - screen_columns(term, signs, system).gain))


def sign_columns(term: Term, state: State) -> Columns:
    """What a sharper turn-over of friction would change in the term's channels, a column per joint.

    A torque that comes late lets friction turn over late, and the turn-over chosen without the delay has
    already swallowed much of it: a delay is judged beside signs that are free to turn over at once.
    """
    context = state.context
    fine, view = context.rows.fine, context.view
    joints = sorted({view.joint_of[c] for c in term.channels})
    sharp = np.tanh(fine.dq[:, joints] / fine.sign_width[joints]) - fine.sign[:, joints]
    change = context.rows.low_pass @ sharp
    out: Columns = {}
    for c in term.channels:
        out[c] = np.zeros_like(change)
        k = joints.index(view.joint_of[c])
        out[c][:, k] = change[:, k]
    used = [k for k in range(len(joints)) if np.abs(change[:, k]).max() > 1e-6]
    return {c: z[:, used] for c, z in out.items()} if used else {}


def beyond_terms(term: Term, cols: Columns) -> Columns:
    """Columns that go with a term and are not of its own parameters."""
    p = len(term.terms)
    return {c: z[:, p:] for c, z in cols.items() if z.shape[1] > p and np.any(z[:, p:])}
