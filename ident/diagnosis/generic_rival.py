"""What anything could explain: products of {1, q, dq, ddq, sign dq, t} of all joints and sin/cos(q) times those.

Where such a nameless column beats the best effect of the catalogue clearly, nobody is blamed and the joint is
reported as unexplained with the variables of the winning columns.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse

from ident.diagnosis.rows import Fine
from ident.diagnosis.scoring import Score, System


@dataclass(frozen=True)
class GenericLibrary:
    """(M, K) filtered products and the variables each one is made of."""

    values: np.ndarray
    variables: tuple[tuple[str, ...], ...]
    products: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)


@dataclass(frozen=True)
class Rival:
    """The best nameless explanation of one channel."""

    channel: int
    variables: tuple[str, ...]
    columns: np.ndarray  # (M, p)
    score: Score
    share_percent: float  # of the channel's residual energy


def build_generic(fine: Fine, low_pass: scipy.sparse.csr_array) -> GenericLibrary:
    """Some nine hundred columns for seven joints, filtered in blocks."""
    n = fine.q.shape[1]
    base: list[tuple[tuple[str, ...], np.ndarray]] = [((), np.ones(len(fine.t)))]
    waves: list[tuple[tuple[str, ...], np.ndarray]] = []
    for k in range(n):
        q = fine.q[:, k]
        centred = q - q.mean()
        base += [
            ((f"q{k + 1}",), centred),
            ((f"dq{k + 1}",), fine.dq[:, k]),
            ((f"ddq{k + 1}",), fine.ddq[:, k]),
            ((f"dq{k + 1}",), fine.sign[:, k]),
        ]
        for m in (1, 2):
            waves += [((f"q{k + 1}",), np.sin(m * q)), ((f"q{k + 1}",), np.cos(m * q))]
    base.append((("t",), fine.t / 60.0))
    names: list[tuple[str, ...]] = []
    parts: list[np.ndarray] = []
    block: list[np.ndarray] = []

    def flush() -> None:
        if block:
            parts.append(low_pass @ np.stack(block, axis=1))
            block.clear()

    def add(one, two) -> None:
        names.append(tuple(sorted({*one[0], *two[0]})))
        block.append(one[1] * two[1])
        if len(block) == 200:
            flush()

    for i, one in enumerate(base):
        for two in base[i:]:
            add(one, two)
    for wave in waves:
        for two in base:
            add(wave, two)
    flush()
    return GenericLibrary(np.hstack(parts), tuple(names))


def best_rival(library: GenericLibrary, system: System, channel: int, size: int = 2) -> Rival | None:
    """Greedy choice of up to `size` columns on one channel by the identify rows; scored on both kinds of rows."""
    mask = system.identify_mask(channel)
    w = system.weight[channel]
    if channel not in library.products:
        masked = library.values * mask[:, None]
        library.products[channel] = (
            system.bank.base[channel].T @ masked,
            np.einsum("ij,ij->j", masked, library.values),
        )
    model, squares = library.products[channel]
    L = library.values
    raw = np.concatenate([model, (system.extra[channel] * mask[:, None]).T @ L])
    XtL = system.basis.T @ raw * w
    norms = squares * w
    left = norms - np.einsum("ij,ij->j", XtL, XtL)
    v = L.T @ (system.residual[channel] * mask) * w
    usable = left > 1e-4 * norms
    chosen: list[int] = []
    directions: list[tuple[np.ndarray, float]] = []
    best: Rival | None = None
    for _ in range(size):
        gain = np.where(usable & (left > 1e-4 * norms), v * v / np.maximum(left, 1e-300), 0.0)
        k = int(np.argmax(gain))
        if gain[k] <= 0:
            break
        chosen.append(k)
        usable[k] = False
        columns = library.values[:, chosen]
        score = system.score({channel: columns})
        if best is None or score.held_out > best.score.held_out:
            share = 100 * (1 - score.rss[channel] / max(system.rss[channel], 1e-30))
            best = Rival(channel, _variables(library, chosen), columns, score, float(np.clip(share, 0, 100)))
        # partial the chosen column out of the others
        cross = L.T @ (L[:, k] * mask) * w - XtL.T @ XtL[:, k]
        for cj, dj in directions:
            cross = cross - cj * cj[k] / dj
        d = max(float(cross[k]), 1e-300)
        v = v - cross * v[k] / d
        left = left - cross * cross / d
        directions.append((cross, d))
    return best


def _variables(library: GenericLibrary, chosen: list[int]) -> tuple[str, ...]:
    found: list[str] = []
    for k in chosen:
        found += [v for v in library.variables[k] if v not in found]
    return tuple(found)
