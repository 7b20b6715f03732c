"""How long a robot must move until two explanations are told apart, as it moves in the recordings at hand."""

from __future__ import annotations

import numpy as np

from ident.diagnosis.evidence.metric import beside_model, orthonormal
from ident.diagnosis.evidence.state import State
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.telling.deciding import seconds_needed

SAME = 1e-4  # share of what is seen of an effect, below which the other one imitates it


def seconds_apart(state: State, term: Term, rival: Term) -> float | None:
    """s of rows that judge until a diagnosis decides between a term of the state and a rival, the rival as
    near to it as its sizes allow; None where it looks the same. What of the term the rival does not imitate
    has the square T a second in whitened rows."""
    number = next(k for k, f in enumerate(state.found) if f.term is term)
    its = state.found[number]
    others = state.but(number)
    m, other = others.metric, others.scene.columns(rival)
    channels = {*its.columns, *other}
    none = np.zeros((len(state.rows.t), 1))
    both = {
        c: np.hstack(
            [
                (its.columns[c] @ its.sizes)[:, None] if c in its.columns else none,
                other.get(c, np.repeat(none, _width(other), axis=1)),
            ]
        )
        for c in channels
    }
    white, seen, left = m.whiten(both), 0.0, 0.0
    for side in (m.fitted, m.judged):
        G, _ = beside_model(m, side, white)
        basis = orthonormal(G[1:, 1:]) if G.shape[0] > 1 else np.zeros((0, 0))
        seen += float(G[0, 0])
        left += float(G[0, 0] - np.sum((basis.T @ G[1:, 0]) ** 2))
    if not left > SAME * seen:
        return None
    period = float(state.rows.usable.sum()) * state.rows.hop
    seconds = seconds_needed(np.array([left / period]), period)
    return seconds if np.isfinite(seconds) else None


def _width(columns: dict[int, np.ndarray]) -> int:
    return next((z.shape[1] for z in columns.values()), 0)
