"""Noise that outlasts what the whitener remembers: how likely a residual is, its slow part being any noise.

Beyond a second an autoregression says nothing, and whatever is slow (a drift, a law of a slow motion) would
be held against noise that has no slow part. So a residual is as likely as it is with a relaxation of any size
and duration in its noise, the one that suits it best (a random walk is one that lasts for ever, noise with a
spectrum of 1/f many): a Gaussian process on the cosines of a run that have periods of more than twice the
memory, the model's parameters free (residual contrasts: H. D. Patterson and R. Thompson, Biometrika 58(3),
1971). Two models are each taken at their best noise, so that n independent slow functions say at most

    n / 2 ln(1 + t^2 / n)

of an effect of t deviations: as little as Student's t with as few degrees of freedom, and more where noise
at the next frequencies is small, as none falls faster than their square."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.rows.whitened import MEMORY_S

MOST = 96  # cosines: of longer recordings the slowest
CORNERS = 0.5 / MEMORY_S * 0.5 ** np.arange(9.0)  # Hz, of relaxations of a third of a second to 80 s
SIZES = np.concatenate([[0.0], np.geomspace(0.1, 1e7, 54)])  # of the slow noise at rest, times the white one
TINY = 1e-300


@dataclass(frozen=True)
class SlowNoise:
    """Of one channel's rows `on` (M,): values (M, k) of its whitened model, times `basis` (k, r) orthonormal
    with those of the other channels; torques `taken` (M, p) that may have any size, orthonormal; free: rows
    less what both determine."""

    rows: Rows
    on: np.ndarray
    values: np.ndarray
    basis: np.ndarray
    taken: np.ndarray
    free: float

    def likelihoods(self, residual: np.ndarray) -> np.ndarray:
        """Logarithms, but for a constant, of a whitened residual (M,) that the model has answered to, in
        noise of each shape and size (J, A)."""
        e = residual[self.on]
        rss = max(float(e @ e), TINY)
        functions, turns, widths, price = self._shapes
        h = (turns @ (functions.T @ e)) ** 2
        left = np.maximum(rss - np.einsum("jk,jka->ja", h, widths), 1e-12 * rss)
        return np.asarray(-0.5 * self.free * np.log(left / self.free) - 0.5 * price)

    def most_likely(self, residual: np.ndarray) -> tuple[np.ndarray, float]:
        """The functions (rows on, K), of unit size where white noise is, of the slow noise that suits a
        residual (M,) best; and the white noise's variance."""
        likelihoods = self.likelihoods(residual)
        j, a = np.unravel_index(int(likelihoods.argmax()), likelihoods.shape)
        functions, turns, widths, _ = self._shapes
        e = residual[self.on]
        h = (turns[j] @ (functions.T @ e)) ** 2
        left = max(float(e @ e) - float(h @ widths[j][:, a]), 1e-12 * float(e @ e), TINY)
        return functions @ turns[j].T * np.sqrt(SIZES[a]), left / self.free

    @cached_property
    def _shapes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Functions (rows on, K); of J relaxations the turns (J, K, K) of their products, by how much a
        square there falls (J, K, A) at each size, and what a size costs (J, A): nothing of what the model
        takes up itself."""
        its = _relaxations(_Times(self.rows, self.on))
        model = np.hstack([self.values[self.on] @ self.basis, self.taken[self.on]])
        cross = its.functions.T @ model
        left = np.linalg.eigvalsh(its.scaled(its.whole - cross @ cross.T))
        price = np.log1p(np.maximum(left, 0.0)[:, :, None] * SIZES).sum(axis=1)
        return its.functions, its.turns, its.widths, price


class _Times:
    """Which instants some rows are of, and of which recordings: all that the slow functions there depend on,
    and the key of a cache."""

    def __init__(self, rows: Rows, on: np.ndarray) -> None:
        self.t, self.recording, self.hop, self.on = rows.t, rows.recording, rows.hop, on
        self.key = (rows.hop, rows.t.tobytes(), rows.recording.tobytes(), on.tobytes())

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Times) and self.key == other.key

    def cosines(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies (K,) [Hz], of a constant half the lowest other one, and functions (rows on, K) of each
        recording, of norm one were all its rows there."""
        number, t, hop = self.recording[self.on], self.t[self.on], self.hop
        chosen = np.unique(number)
        begin = [self.t[self.recording == r].min() - 0.5 * hop for r in chosen]
        spans = [self.t[self.recording == r].max() + 0.5 * hop - b for r, b in zip(chosen, begin)]
        top = min(0.5 / MEMORY_S, MOST / max(2 * sum(spans), TINY))
        f, functions = [np.zeros(0)], [np.zeros((len(t), 0))]
        for r, b, span in zip(chosen, begin, spans):
            k = np.arange(int(2 * span * top) + 1)
            wave = np.cos(np.pi * np.outer((t - b) / span, k)) * np.sqrt(np.where(k, 2, 1) * hop / span)
            functions.append(np.where((number == r)[:, None], wave, 0.0))
            f.append(np.maximum(k, 0.5) / (2 * span))
        return np.concatenate(f), np.hstack(functions)


@dataclass(frozen=True)
class _Relaxations:
    """What of `SlowNoise._shapes` no model enters; whole (K, K): products of the functions; roots (J, K)."""

    functions: np.ndarray
    whole: np.ndarray
    roots: np.ndarray
    turns: np.ndarray
    widths: np.ndarray

    def scaled(self, products: np.ndarray) -> np.ndarray:
        """(J, K, K): products (K, K) of the functions as each relaxation has them."""
        return np.asarray(products * self.roots[:, :, None] * self.roots[:, None, :])


@lru_cache(maxsize=24)  # of eight channels the fitted rows, the judged ones, both
def _relaxations(times: _Times) -> _Relaxations:
    f, functions = times.cosines()
    whole = functions.T @ functions
    roots = np.vstack([1 / np.sqrt(1 + (f / CORNERS[:, None]) ** 2), np.sqrt(CORNERS[-1] / f)])
    s, U = np.linalg.eigh(whole * roots[:, :, None] * roots[:, None, :])
    turns = np.swapaxes(U, 1, 2) * roots[:, None, :]
    return _Relaxations(functions, whole, roots, turns, SIZES / (1 + np.maximum(s, 0.0)[:, :, None] * SIZES))
