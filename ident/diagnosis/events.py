"""Loads of the whole robot: undeclared payloads (a run, or from a moment on), contacts, a tilted base.

Windows are searched by cumulative Gram matrices: sums over half-second blocks of a unit load's products
with the model, itself and the residual give the gain of every window without touching the rows again. The
held-out test is alternating blocks of all the runs, fitted apart and swapped, so a window is judged inside
itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.candidates import Ranked
from ident.diagnosis.scoring import Columns, Folds, System
from ident.diagnosis.terms import Context, Term, columns
from modelgen.effects import catalogue

BLOCK_SECONDS = 0.5
SHORTEST_CONTACT = 0.75  # s
MARGIN = 1.0  # s from the ends of a run
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


@dataclass(frozen=True, slots=True)
class Sums:
    """Cumulative products of a unit load on one run: with the model, itself and the residual, block by
    block."""

    edges: np.ndarray  # (B + 1,) s
    model: np.ndarray  # (B + 1, b, p)
    own: np.ndarray  # (B + 1, p, p)
    residual: np.ndarray  # (B + 1, p)

    def gains(self, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gain (K,) and coefficients (K, p) of the windows between edges pairs[:, 0] and pairs[:, 1]."""
        i, j = pairs[:, 0], pairs[:, 1]
        a = self.model[j] - self.model[i]
        g = self.own[j] - self.own[i]
        h = self.residual[j] - self.residual[i]
        left = g - np.swapaxes(a, 1, 2) @ a
        scale = np.sqrt(np.maximum(np.einsum("kii->ki", g), 1e-300))
        normal = left / scale[:, :, None] / scale[:, None, :] + 1e-6 * np.eye(g.shape[1])
        x = np.linalg.solve(normal, (h / scale)[:, :, None])[:, :, 0]
        return 0.5 * np.einsum("ki,ki->k", x, h / scale), x / scale


def _whole(term: Term, context: Context) -> Columns:
    """Filtered columns of the load as if it acted all the time."""
    key = ("filtered", term.effect.name)
    if key not in context.cache:
        context.cache[key] = columns(replace(term, run=None, window=None), context)
    return context.cache[key]


def _sums(term: Term, context: Context, system: System, r: int, edges: np.ndarray) -> Sums | None:
    rows = context.rows
    inside = np.flatnonzero((rows.run == r) & (system.folds.sets >= 0))
    if len(inside) < 20:
        return None
    B = len(edges) - 1
    number = np.searchsorted(edges, rows.t[inside], side="right") - 1
    firsts = np.searchsorted(number, np.arange(B + 1))
    cols = _whole(term, context)
    p = next(iter(cols.values())).shape[1]
    k = system.basis.shape[0]
    A, G, v = np.zeros((B, k, p)), np.zeros((B, p, p)), np.zeros((B, p))
    for c, Z in cols.items():
        w = np.sqrt(system.weight[c]) * system.keep[c, inside]
        z = Z[inside] * w[:, None]
        x = np.hstack([system.bank.base[c, inside], system.extra[c, inside]]) * w[:, None]
        e = system.residual[c, inside] * w
        for i in range(B):
            s = slice(firsts[i], firsts[i + 1])
            if s.stop > s.start:
                A[i] += x[s].T @ z[s]
                G[i] += z[s].T @ z[s]
                v[i] += z[s].T @ e[s]
    turned = np.matmul(system.basis.T, A)
    totals = [np.concatenate([np.zeros((1, *a.shape[1:])), np.cumsum(a, axis=0)]) for a in (turned, G, v)]
    return Sums(edges, *totals)


def _search(
    term: Term, context: Context, system: System, r: int, shortest: float, to_end: bool
) -> list[Ranked]:
    edges = np.arange(0.0, context.rows.runs[r].duration + 2 * BLOCK_SECONDS, BLOCK_SECONDS)
    sums = _sums(term, context, system, r, edges)
    if sums is None:
        return []
    B = len(edges) - 1
    least = int(np.ceil(shortest / BLOCK_SECONDS))
    if to_end:
        starts = np.arange(least, B - least + 1)
        pairs = np.stack([starts, np.full(len(starts), B)], axis=1)
    else:
        i, j = np.triu_indices(B + 1, least)
        pairs = np.stack([i, j], axis=1)
        pairs = pairs[(pairs[:, 1] - pairs[:, 0]) <= 0.7 * B]
        last = int(context.rows.runs[r].duration / BLOCK_SECONDS)
        inside = (pairs[:, 0] * BLOCK_SECONDS > MARGIN) & (pairs[:, 1] < last - MARGIN / BLOCK_SECONDS)
        pairs = pairs[inside]  # at the ends a window would take static friction
        if len(pairs) > 3000:
            pairs = pairs[(pairs % 2 == 0).all(axis=1) | (pairs[:, 1] - pairs[:, 0] < 3 * least)]
    if not len(pairs):
        return []
    gain, x = sums.gains(pairs)
    if term.effect.name == "payload_change":
        gain = np.where(x[:, 0] > 0, gain, 0.0)
    share = float(np.mean(system.share))
    out: list[Ranked] = []
    for k in np.argsort(gain)[::-1]:
        lo, hi = edges[pairs[k, 0]], edges[pairs[k, 1]]
        if any(min(hi, o.term.window[1]) - max(lo, o.term.window[0]) > 0 for o in out):  # type: ignore[index]
            continue
        window = (float(lo), np.inf) if to_end else (float(lo), float(hi))
        out.append(Ranked(replace(term, window=window), share * float(gain[k]), bool(gain[k] > 0)))
        if len(out) == 3 or to_end:
            break
    return out


def refine_window(term: Term, context: Context, system: System) -> Term:
    """Move the edges of a window where the gain is largest, on a grid of 0.05 s around them."""
    if term.window is None or term.run is None:
        return term
    end = context.rows.runs[term.run].duration
    lo, hi = term.window
    fine = [np.arange(lo - 2 * BLOCK_SECONDS, lo + 2 * BLOCK_SECONDS, 0.05)]
    if np.isfinite(hi):
        fine += [np.arange(hi - 2 * BLOCK_SECONDS, hi + 2 * BLOCK_SECONDS, 0.05)]
    edges = np.unique(np.clip(np.concatenate([*fine, [0.0, end + 1.0]]), 0.0, end + 1.0))
    sums = _sums(term, context, system, term.run, edges)
    if sums is None:
        return term
    starts = np.flatnonzero(np.abs(edges - lo) <= 2 * BLOCK_SECONDS)
    stops = np.flatnonzero(np.abs(edges - hi) <= 2 * BLOCK_SECONDS) if np.isfinite(hi) else [len(edges) - 1]
    pairs = np.array([(i, j) for i in starts for j in stops if edges[j] - edges[i] > 0.3])
    if not len(pairs):
        return term
    gain, _ = sums.gains(pairs)
    i, j = pairs[int(np.argmax(gain))]
    return replace(term, window=(float(edges[i]), float(edges[j]) if np.isfinite(hi) else np.inf))
