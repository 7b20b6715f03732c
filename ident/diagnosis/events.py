"""Loads of the whole robot: undeclared payloads (a run, or from a moment on), contacts, a tilted base.

Windows are searched by cumulative Gram matrices: sums over half-second blocks of a unit load's products with the
model, itself and the residual give the gain of every window without touching the rows again. The held-out test is
alternating blocks of all the runs, fitted apart and swapped, so a window is judged inside itself.
"""

from collections.abc import Sequence

import numpy as np

from ident.diagnosis.candidates import Ranked
from ident.diagnosis.scoring import Folds, System
from ident.diagnosis.terms import Context, Term, columns
from modelgen.effects import catalogue

BLOCK_SECONDS = 0.5
SHORTEST_CONTACT = 0.75  # s
SHORTEST_PAYLOAD = 4.0  # s, and as long without it


def block_folds(run: np.ndarray, t: np.ndarray, usable: np.ndarray, seconds: float = 1.5) -> Folds:
    """Two sets of alternating blocks over all usable rows; each predicts the other."""
    sets = np.full(len(run), -1)
    sets[usable] = (np.floor(t[usable] / seconds).astype(int) + run[usable]) % 2
    return Folds(sets, (0, 1), (((0,), (1,)), ((1,), (0,))), False)


def load_terms(context: Context, tilt: bool = True) -> list[Term]:
    """Payload on each whole run (when there are several) and the tilted base."""
    known = catalogue()
    every = tuple(range(len(context.view.channels)))
    out = []
    if tilt:
        out.append(Term(known["base_tilt"], None, every, ("roll", "pitch")))
    roles = [r.role for r in context.rows.runs]
    usable = [i for i, role in enumerate(roles) if role != "test"]
    if len(usable) > 1:
        effect = known["payload_change"]
        for r in usable:
            out.append(Term(effect, None, every, ("M", "MX", "MY", "MZ"), run=r))
    return out


def window_terms(
    context: Context, system: System, usable_runs: Sequence[int], count: int = 3
) -> list[Ranked]:
    """Best windows of a payload from a moment on and of a contact, run by run."""
    known = catalogue()
    every = tuple(range(len(context.view.channels)))
    out: list[Ranked] = []
    for r in usable_runs:
        duration = context.rows.runs[r].duration
        payload = Term(known["payload_change"], None, every, ("M", "MX", "MY", "MZ"), run=r)
        contact = Term(known["external_force"], None, every, ("FX", "FY", "FZ"), run=r)
        if duration > 2 * SHORTEST_PAYLOAD:
            out += _search(payload, context, system, r, SHORTEST_PAYLOAD, to_end=True)[:count]
        if duration > 4 * SHORTEST_CONTACT:
            out += _search(contact, context, system, r, SHORTEST_CONTACT, to_end=False)[:count]
    return out


def _search(
    term: Term, context: Context, system: System, r: int, shortest: float, to_end: bool
) -> list[Ranked]:
    rows = context.rows
    inside = (rows.run == r) & (system.folds.sets >= 0)
    if inside.sum() < 20:
        return []
    t = rows.t[inside]
    edges = np.arange(0.0, rows.runs[r].duration + BLOCK_SECONDS, BLOCK_SECONDS)
    number = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(edges) - 2)
    B = len(edges) - 1
    cols = columns(term, context)
    p = next(iter(cols.values())).shape[1]
    b = system.X.shape[2]
    A, G, v = np.zeros((B, b, p)), np.zeros((B, p, p)), np.zeros((B, p))
    firsts = np.searchsorted(number, np.arange(B + 1))
    for c, Z in cols.items():
        w = np.sqrt(system.weight[c]) * system.keep[c, inside]
        z = Z[inside] * w[:, None]
        x = system.X[c, inside] * w[:, None]
        e = system.residual[c, inside] * w
        for i in range(B):
            s = slice(firsts[i], firsts[i + 1])
            A[i] += x[s].T @ z[s]
            G[i] += z[s].T @ z[s]
            v[i] += z[s].T @ e[s]
    cA, cG, cv = (np.concatenate([np.zeros((1, *a.shape[1:])), np.cumsum(a, axis=0)]) for a in (A, G, v))
    least = int(np.ceil(shortest / BLOCK_SECONDS))
    if to_end:
        starts = np.arange(least, B - least + 1)
        pairs = np.stack([starts, np.full(len(starts), B)], axis=1)
    else:
        i, j = np.triu_indices(B + 1, least)
        pairs = np.stack([i, j], axis=1)
        pairs = pairs[(pairs[:, 1] - pairs[:, 0]) <= 0.7 * B]
        if len(pairs) > 3000:
            pairs = pairs[(pairs % 2 == 0).all(axis=1) | (pairs[:, 1] - pairs[:, 0] < 3 * least)]
    if not len(pairs):
        return []
    a = cA[pairs[:, 1]] - cA[pairs[:, 0]]
    g = cG[pairs[:, 1]] - cG[pairs[:, 0]]
    h = cv[pairs[:, 1]] - cv[pairs[:, 0]]
    left = g - np.swapaxes(a, 1, 2) @ a
    scale = np.sqrt(np.maximum(np.einsum("kii->ki", g), 1e-300))
    normal = left / scale[:, :, None] / scale[:, None, :] + 1e-6 * np.eye(p)
    x = np.linalg.solve(normal, (h / scale)[:, :, None])[:, :, 0]
    gain = 0.5 * np.einsum("ki,ki->k", x, h / scale)
    share = float(np.mean(system.share))
    if term.effect.name == "payload_change":
        gain = np.where(x[:, 0] > 0, gain, 0.0)
    out: list[Ranked] = []
    for k in np.argsort(gain)[::-1]:
        lo, hi = edges[pairs[k, 0]], edges[pairs[k, 1]]
        if any(min(hi, o.term.window[1]) - max(lo, o.term.window[0]) > 0 for o in out):  # type: ignore[index]
            continue
        window = (float(lo), np.inf) if to_end else (float(lo), float(hi))
        placed = Term(term.effect, None, term.channels, term.terms, run=r, window=window)
        out.append(Ranked(placed, share * float(gain[k]), bool(gain[k] > 0)))
        if len(out) == 3 or to_end:
            break
    return out


def refine_window(term: Term, context: Context, system: System) -> Term:
    """Move the edges of a window where the gain is largest, down to 0.05 s."""
    if term.window is None:
        return term

    def gain(window: tuple[float, float]) -> float:
        if window[1] - window[0] < 0.3:
            return -np.inf
        placed = Term(term.effect, None, term.channels, term.terms, run=term.run, window=window)
        return system.score(columns(placed, context)).identify

    window = term.window
    best = gain(window)
    for step in (0.25, 0.1, 0.05):
        for _turn in range(6):
            moved = False
            for edge in (0, 1):
                if not np.isfinite(window[edge]):
                    continue
                for sign in (-1, 1):
                    trial = list(window)
                    trial[edge] += sign * step
                    value = gain((trial[0], trial[1]))
                    if value > best:
                        best, window, moved = value, (trial[0], trial[1]), True
            if not moved:
                break
    return Term(term.effect, None, term.channels, term.terms, run=term.run, window=window)
