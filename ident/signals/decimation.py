"""Parallel decimation: the zero-phase Butterworth low-pass of low_pass.py at the kept instants only.

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

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from ident.signals.low_pass import TAIL, LowPass

OVERSAMPLING = 2.5  # kept instants per second and Hz of cut-off
FINE_HZ = 200.0  # at which columns of effects are made, see equations/fine.py
NEAR = 0.04  # by which D is rounded for them


def kept_every(cutoff_hz: float, rate_hz: float) -> int:
    """D: samples from one kept instant to the next, where that is near a multiple of the samples from one to
    the next at FINE_HZ. (Of 1 kHz D was 83, which has no divisor: columns were made of all samples, five
    times as many as of D = 85.)"""
    plain = max(1, round(rate_hz / (OVERSAMPLING * cutoff_hz)))
    near = (s * round(plain / s) for s in range(min(plain, at_most(rate_hz, FINE_HZ)), 0, -1))
    return next(every for every in near if abs(every - plain) <= NEAR * plain)


def at_most(rate_hz: float, least_hz: float) -> int:
    """The most samples of which one is kept where about such a rate is left."""
    return max(1, int(1.01 * rate_hz / least_hz))


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
def _weights(filter: LowPass, every: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """(D, 9) weights, (D + 1, 9) sums of the first of them, p, c, d."""
    p, c, d = response_terms(filter)
    i = np.arange(every)
    left, right = p[None, :] ** (every - 1 - i)[:, None], p[None, :] ** (i + 1)[:, None]
    at_instant = (i == every - 1).astype(float)[:, None]
    weights = np.hstack([left.real, left.imag, right.real, right.imag, at_instant])
    return weights, np.cumsum(np.vstack([np.zeros_like(weights[:1]), weights]), axis=0), p, c, d


class Decimator:
    """Feeds on values (m, N) of one segment, sample after sample; gives back (m, kept) at instants D-1,
    2D-1, ...

    `push` returns what became final, `finish` the rest. Kept instants become final once the response has died
    out (TAIL) behind them, so some 15 / cut-off seconds are pending and memory is constant.
    """

    def __init__(self, filter: LowPass, every: int, rows: int) -> None:
        self.every = every
        self.weights, self.first, self.p, self.c, self.d = _weights(filter, every)
        slowest = float(np.abs(self.p).max())
        self.behind = int(np.ceil(np.log(TAIL) / np.log(slowest) / every)) + 1
        self.rows = rows
        self.filled = 0
        self.current = np.zeros((rows + 1, self.weights.shape[1]))
        self.sums: list[np.ndarray] = []
        self.left = np.zeros((rows + 1, len(self.p)), complex)

    def push(self, values: np.ndarray) -> np.ndarray | None:
        """values (rows, N) -> (rows, kept) or None when nothing became final."""
        D, total = self.every, values.shape[1]
        head = min(-self.filled % D, total)
        self._add(values[:, :head])
        whole = (total - head) // D
        if whole:
            blocks = values[:, head : head + whole * D].reshape(self.rows, whole, D).swapaxes(0, 1)
            sums = np.empty((whole, *self.current.shape))
            np.matmul(blocks, self.weights, out=sums[:, :-1])
            sums[:, -1] = self.first[D]
            self.sums.extend(sums)
        self._add(values[:, head + whole * D :])
        if len(self.sums) >= 2 * self.behind + 8:
            return self._give(len(self.sums) - self.behind)
        return None

    def _add(self, values: np.ndarray) -> None:
        """Samples of the block that is being filled, and perhaps its last."""
        count = values.shape[1]
        if not count:
            return
        its = slice(self.filled, self.filled + count)
        self.current[:-1] += values @ self.weights[its]
        self.current[-1] += self.first[its.stop] - self.first[its.start]
        self.filled += count
        if self.filled == self.every:
            self.sums.append(self.current)
            self.current = np.zeros_like(self.current)
            self.filled = 0

    def finish(self) -> np.ndarray:
        """The instants still pending; samples after the last one are taken into account."""
        whole = len(self.sums)
        if self.filled:
            self.sums.append(self.current)
        return self._give(whole)

    def _give(self, count: int) -> np.ndarray:
        k, step, many = len(self.p), self.p**self.every, len(self.sums)
        blocks = np.stack(self.sums) if many else np.zeros((0, *self.current.shape))
        left = blocks[:count, :, :k] + 1j * blocks[:count, :, k : 2 * k]
        right = blocks[1:, :, 2 * k : 3 * k] + 1j * blocks[1:, :, 3 * k : 4 * k]  # of the instant before
        for m in range(count):
            left[m] += self.left * step
            self.left = left[m]
        for m in range(many - 3, -1, -1):
            right[m] += right[m + 1] * step
        kept = (left @ self.c).real + self.d * blocks[:count, :, -1]
        kept[: many - 1] += (right[:count] @ self.c).real
        self.left, self.sums = self.left.copy(), self.sums[count:]
        return np.ascontiguousarray((kept[:, :-1] / kept[:, -1:]).T)


def decimate(values: np.ndarray, rate_hz: float, cutoff_hz: float, order: int = 4) -> np.ndarray:
    """Columns of values (N, m) -> (kept, m), whole in memory (the slow twin of the tests calls this too)."""
    decimator = Decimator(LowPass(cutoff_hz, rate_hz, order), kept_every(cutoff_hz, rate_hz), values.shape[1])
    parts: Iterator[np.ndarray | None] = iter((decimator.push(values.T), decimator.finish()))
    return np.concatenate([part.T for part in parts if part is not None])


def means_about(values: np.ndarray, kept: np.ndarray, step: int) -> np.ndarray:
    """(N, m) -> (K, m): mean over the step about each kept sample (K,), half a sample at either end where
    the step is even, shorter near the ends of what there is. It is symmetric everywhere: a mean that is not
    is that of another instant, half a sample off."""
    reach = np.minimum(np.minimum(kept, len(values) - 1 - kept), step // 2)
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    total = sums[kept + reach + 1] - sums[kept - reach]
    ends = np.where(reach == step / 2, 0.5, 0.0)[:, None]
    ends_off = ends * (values[kept + reach] + values[kept - reach])
    return np.asarray((total - ends_off) / (2 * reach[:, None] + 1 - 2 * ends))
