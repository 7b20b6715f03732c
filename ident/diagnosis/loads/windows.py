"""Windows of loads, searched in steps: products of a unit load with the model, itself and the residual,
summed over short blocks once, give the gain of any window as small dense algebra. Lengths grow by a constant
ratio and starts by a quarter of the length, so their number grows as the recording's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.metric import Metric
from ident.diagnosis.evidence.state import State
from ident.diagnosis.loads.is_a_load import SHORTEST_S
from ident.diagnosis.rows.terms import Term
from modelgen.effects.effect import Effect
from modelgen.effects.place import Place

STEP_S = 0.5  # s: edges of the search
RATIO = 1.5  # of window lengths
MARGIN_S = 1.0  # s from the ends, where a window would take up static friction


def windows_of(
    m: Metric, columns: dict[int, np.ndarray], state: State, place: Place, part: bool, only_whole: bool
) -> tuple[list[tuple[float | None, float | None]], np.ndarray]:
    mine, t = since(state, place)
    if len(t) < 20:
        return [], np.zeros(0)
    edges = _edges(t)
    sums = _sums(m, columns, mine, t, edges)
    B = len(edges) - 1
    pairs = [(0, B)] if only_whole else _pairs(B)
    if part:
        pairs = pairs[1:]
    if not pairs:
        return [], np.zeros(0)
    chosen = np.array(pairs)
    gains = gains_of(sums, chosen)
    windows = [(None if a == 0 else float(edges[a]), None if b == B else float(edges[b])) for a, b in chosen]
    return windows, gains


def windows_tried(state: State, place: Place) -> int:
    """Of how many windows of its recording a load's has been chosen; 1 of what acts all along one."""
    if place.recording is None or not place.comes_and_goes:
        return 1
    return len(_pairs(len(_edges(since(state, place)[1])) - 1))


def _edges(t: np.ndarray) -> np.ndarray:
    """(B+1,) [s] of the blocks of the search."""
    cells = np.unique(np.floor(t / STEP_S))  # a pause is one block, however long
    return np.union1d(cells, cells + 1) * STEP_S


def _pairs(B: int) -> list[tuple[int, int]]:
    """Windows by the blocks that they begin and end with: all of them, then parts."""
    pairs = [(0, B)]
    least, margin = int(SHORTEST_S / STEP_S), int(MARGIN_S / STEP_S)
    length = float(least)
    while length < 0.7 * B:
        n = round(length)
        pairs += [(a, a + n) for a in range(margin, B - n - margin + 1, max(1, n // 4))]
        length *= RATIO
    return pairs + [(a, B) for a in range(least, B - least + 1)]


def _sums(
    m: Metric, columns: dict[int, np.ndarray], mine: np.ndarray, t: np.ndarray, edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cumulative products over the blocks between edges: with the model (B+1, r, p), own, with the
    residual."""
    p = next(iter(columns.values())).shape[1]
    r, B = m.fitted.basis.shape[1], len(edges) - 1
    block = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, B - 1)
    cross, own, right = np.zeros((B, r, p)), np.zeros((B, p, p)), np.zeros((B, p))
    firsts = np.searchsorted(block, np.arange(B + 1))
    for c, z in columns.items():
        white = (m.whiteners[c] @ z)[mine] * (m.fitted.mask & m.rows.use[c])[mine, None]
        places, values = m.X[c]
        X = values[mine] @ m.fitted.basis[places]
        e = m.fitted.residual[c, mine]
        for k in range(B):
            s = slice(firsts[k], firsts[k + 1])
            if s.stop > s.start:
                cross[k] += X[s].T @ white[s]
                own[k] += white[s].T @ white[s]
                right[k] += white[s].T @ e[s]

    def cumulative(a: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros((1, *a.shape[1:])), np.cumsum(a, axis=0)])

    return cumulative(cross), cumulative(own), cumulative(right)


def gains_of(sums: tuple[np.ndarray, np.ndarray, np.ndarray], pairs: np.ndarray) -> np.ndarray:
    cross, own, right = sums
    a, b = pairs[:, 0], pairs[:, 1]
    x, g, h = cross[b] - cross[a], own[b] - own[a], right[b] - right[a]
    left = g - np.swapaxes(x, 1, 2) @ x
    scale = np.sqrt(np.maximum(np.einsum("kii->ki", g), 1e-300))
    normal = left / scale[:, :, None] / scale[:, None, :] + 1e-6 * np.eye(g.shape[1])
    told = h / scale
    size = np.linalg.solve(normal, told[:, :, None])[:, :, 0]
    return 0.5 * np.einsum("ki,ki->k", size, told)


def since(state: State, place: Place) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a place's recording and their time since its first sample."""
    number = state.rows.names.index(str(place.recording))
    mine = np.flatnonzero(state.rows.recording == number)
    return mine, state.rows.t[mine] - state.begins(place.recording)


def part_alone(state: State, effect: Effect) -> bool:
    """Whether it may act in a part of a recording alone: on the only one a load all along is the model's."""
    return effect.transient or len(state.rows.roles) < 2


def with_window(term: Term, start: float | None, stop: float | None) -> Term:
    return replace(term, place=replace(term.place, start=start, stop=stop))
