"""Parallel decimation: the zero-phase Butterworth low-pass of filtering.py at the kept instants only.

The impulse response of G = |H|^2 is a sum of two-sided exponentials,

    g[n] = d delta[n] + sum_k c_k p_k^|n|,   p_k the stable poles of H,

so the filtered value at an instant is a left sum plus a right sum that recur from one kept instant to the
next with the factor p^D, D the samples between two of them. What a block of D samples contributes is its
product with D x 9 real weights (order 4): W (channels x parameters wide) at 1 kHz is folded as fast as it
is evaluated and never held. Rate: 2.5 x cut-off, as the paper's `decimate` (cut-off at 0.8 of the new
Nyquist frequency).

Y and every column of W run through the same weights, which makes any linear filter admissible: at the ends
of a segment, where the response is cut off, each row is only rescaled to unit gain and stays a true equation.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from ident.signals.filtering import TAIL, LowPass

OVERSAMPLING = 2.5  # kept instants per second and Hz of cut-off


def kept_every(cutoff_hz: float, rate_hz: float) -> int:
    """D: samples from one kept instant to the next."""
    return max(1, round(rate_hz / (OVERSAMPLING * cutoff_hz)))


def response_terms(filter: LowPass) -> tuple[np.ndarray, np.ndarray, float]:
    """p (K,), c (K,) complex, d of the impulse response; conjugate pairs once, with c doubled."""
    order = filter.order
    poles = filter.poles()
    gain = np.tan(np.pi * filter.cutoff_hz / filter.rate_hz) ** (2 * order)
    leading = gain + (-1.0) ** order
    c = np.empty(order, complex)
    for k, p in enumerate(poles):
        others = np.delete(poles, k)
        c[k] = gain * (p + 1) ** (2 * order) / (p * leading * np.prod(p - others) * np.prod(p - 1 / poles))
    once = poles.imag > -1e-12
    c = np.where(poles.imag > 1e-12, 2 * c, c)
    return poles[once], c[once], float(gain / leading)


@lru_cache(maxsize=32)
def _weights(filter: LowPass, every: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    p, c, d = response_terms(filter)
    i = np.arange(every)
    left, right = p[None, :] ** (every - 1 - i)[:, None], p[None, :] ** (i + 1)[:, None]
    at_instant = (i == every - 1).astype(float)[:, None]
    return np.hstack([left.real, left.imag, right.real, right.imag, at_instant]), p, c, d


class Decimator:
    """Feeds on values (m, N) of one segment, sample after sample; gives back (m, kept) at instants D-1,
    2D-1, ...

    `push` returns what became final, `finish` the rest. Kept instants become final once the response has died
    out (TAIL) behind them, so some 15 / cut-off seconds are pending and memory is constant.
    """

    def __init__(self, filter: LowPass, every: int, rows: int) -> None:
        self.every = every
        self.weights, self.p, self.c, self.d = _weights(filter, every)
        slowest = float(np.abs(self.p).max())
        self.behind = int(np.ceil(np.log(TAIL) / np.log(slowest) / every)) + 1
        self.rows = rows
        self.filled = 0
        self.current = np.zeros((rows + 1, self.weights.shape[1]))
        self.sums: list[np.ndarray] = []
        self.left = np.zeros((rows + 1, len(self.p)), complex)

    def push(self, values: np.ndarray) -> np.ndarray | None:
        """values (rows, N) -> (rows, kept) or None when nothing became final."""
        start, total = 0, values.shape[1]
        while start < total:
            stop = min(total, start + self.every - self.filled)
            weights = self.weights[self.filled : self.filled + stop - start]
            self.current[:-1] += values[:, start:stop] @ weights
            self.current[-1] += weights.sum(axis=0)
            self.filled += stop - start
            start = stop
            if self.filled == self.every:
                self.sums.append(self.current)
                self.current = np.zeros_like(self.current)
                self.filled = 0
        if len(self.sums) >= 2 * self.behind + 8:
            return self._give(len(self.sums) - self.behind)
        return None

    def finish(self) -> np.ndarray:
        """The instants still pending; samples after the last one are taken into account."""
        whole = len(self.sums)
        if self.filled:
            self.sums.append(self.current)
        return self._give(whole)

    def _give(self, count: int) -> np.ndarray:
        k, step = len(self.p), self.p**self.every
        kept = np.empty((self.rows + 1, count))
        for m in range(count):
            block = self.sums[m]
            self.left = self.left * step + (block[:, :k] + 1j * block[:, k : 2 * k])
            kept[:, m] = (self.left @ self.c).real + self.d * block[:, -1]
        right = np.zeros_like(self.left)
        for m in range(len(self.sums) - 1, 0, -1):  # block m lies to the right of instant m - 1
            block = self.sums[m]
            right = right * step + (block[:, 2 * k : 3 * k] + 1j * block[:, 3 * k : 4 * k])
            if m - 1 < count:
                kept[:, m - 1] += (right @ self.c).real
        self.sums = self.sums[count:]
        return kept[:-1] / kept[-1]


def decimate(values: np.ndarray, rate_hz: float, cutoff_hz: float, order: int = 4) -> np.ndarray:
    """Columns of values (N, m) -> (kept, m), whole in memory (the slow twin of the tests calls this too)."""
    decimator = Decimator(LowPass(cutoff_hz, rate_hz, order), kept_every(cutoff_hz, rate_hz), values.shape[1])
    parts: Iterator[np.ndarray | None] = iter((decimator.push(values.T), decimator.finish()))
    return np.concatenate([part.T for part in parts if part is not None])


def folded(values: np.ndarray, number: np.ndarray, filter: LowPass, every: int, kept: int) -> np.ndarray:
    """Columns of values (N, m) at some samples only, `number` (N,) of the segment's -> (kept, m).

    Each sample has the weight that `Decimator` gives it; the rows are rescaled to unit gain as there.
    """
    decimator = Decimator(filter, every, values.shape[1])
    bounds = np.searchsorted(number, np.arange(kept + 2) * every)
    for start, stop in itertools.pairwise(bounds):
        weights = decimator.weights[number[start:stop] % every]
        decimator.sums.append(np.vstack([values[start:stop].T @ weights, weights.sum(axis=0)]))
    return decimator._give(kept).T
