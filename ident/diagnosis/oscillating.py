"""A residual that oscillates of its own: a vibration, a slosh.

Slow noise forgets: its autocovariance is a sum of relaxations, a exp(-|lag| / T) with a >= 0, and its
spectrum only falls. An oscillation is b exp(-|lag| / T) cos(2 pi f lag) beside it, and larger than all of
these (less of it is the edge of a filter, too). f, T and b are learned on the fitted rows; what the judged
ones say of it is their Gaussian log-likelihood with it, less that without, the sizes of white noise and
relaxations at their most likely each time, beside what the parameters' uncertainty makes there. Rows that do
not count are gaps in both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize

from ident.diagnosis.rows import Rows

SIZE, LEAST, MOST = 256, 64, 12  # rows of a block, at least; blocks of a side
RELAXATIONS = 5
PERIODS = (1.0, 3.0, 10.0)  # that an oscillation may last
TURNS = 30  # of the search for the sizes: each raises the likelihood


@dataclass(frozen=True, slots=True)
class Block:
    """Rows that are read together: their times (k,) [s], the residual (k,) and the covariance (k, k) that it
    has whatever the noise."""

    t: np.ndarray
    residual: np.ndarray
    known: np.ndarray


def oscillation_says(hop: float, fitted: Sequence[Block], judged: Sequence[Block]) -> float:
    """log E of an oscillation, learned on the fitted blocks, on the judged ones; hop [s]: of the rows."""
    if not fitted or not judged:
        return 0.0
    shapes = [0.0, *np.geomspace(2 * hop, SIZE * hop, RELAXATIONS)]
    noise = [_relaxations(b.t, shapes) for b in fitted]
    f = _frequency(hop, fitted)
    learned = []
    for T in (periods / f for periods in PERIODS):
        parts = [[*its, _oscillation(b.t, f, T)] for b, its in zip(fitted, noise)]
        sizes, likelihood = most_likely(fitted, parts)
        learned.append((likelihood, T, sizes))
    _, T, (*others, size) = max(learned, key=lambda its: its[0])
    if size < sum(others):
        return 0.0
    noise = [_relaxations(b.t, shapes) for b in judged]
    beside = [Block(b.t, b.residual, b.known + size * _oscillation(b.t, f, T)) for b in judged]
    return most_likely(beside, noise)[1] - most_likely(judged, noise)[1]


def blocks(
    rows: Rows,
    residual: np.ndarray,
    on: np.ndarray,
    uncertain: tuple[np.ndarray, np.ndarray] | None = None,
) -> list[Block]:
    """Of a channel's residual (M,), over the rows `on` (M,); uncertain: columns (M, k) of W and the
    covariance (k, k) of their parameters, None where these were fitted to the rows themselves."""
    out = []
    for piece in np.unique(rows.piece[on]):
        mine = np.flatnonzero(on & (rows.piece == piece))
        parts = np.array_split(mine, max(1, round(len(mine) / SIZE)))
        out += [part for part in parts if len(part) >= LEAST]
    spread = np.unique(np.linspace(0, len(out) - 1, MOST).round().astype(int)) if out else ()

    def known(part: np.ndarray) -> np.ndarray:
        if uncertain is None:
            return np.zeros((len(part), len(part)))
        X, covariance = uncertain
        return np.asarray(X[part] @ covariance @ X[part].T)

    return [Block(rows.t[out[k]], residual[out[k]], known(out[k])) for k in spread]


def most_likely(blocks: Sequence[Block], parts: Sequence[Sequence[np.ndarray]]) -> tuple[np.ndarray, float]:
    """Sizes (k,) >= 0 of the parts (k, n, n) of each block's covariance, and the log-likelihood with them.
    Minorisation (H. Zhou and others, J. Comput. Graph. Stat. 28, 2019): no step lowers it."""
    power = float(np.mean(np.concatenate([b.residual**2 for b in blocks])))
    sizes = np.full(len(parts[0]), max(power, 1e-300) / len(parts[0]))
    likelihood = -np.inf
    for _ in range(TURNS):
        likelihood, up, down = 0.0, np.zeros(len(sizes)), np.zeros(len(sizes))
        for b, its in zip(blocks, parts):
            K = b.known + sum(a * part for a, part in zip(sizes, its))
            L = scipy.linalg.cholesky(K + 1e-9 * power * np.eye(len(K)), lower=True, check_finite=False)
            inverse = scipy.linalg.lapack.dpotri(L, lower=True)[0]
            inverse = np.tril(inverse) + np.tril(inverse, -1).T
            e = inverse @ b.residual
            likelihood -= float(np.log(np.diag(L)).sum()) + 0.5 * float(b.residual @ e)
            up += [e @ (part @ e) for part in its]
            down += [np.vdot(inverse, part) for part in its]
        sizes = sizes * np.sqrt(up / np.maximum(down, 1e-300))
    return sizes, likelihood


def _relaxations(t: np.ndarray, lasting: Sequence[float]) -> list[np.ndarray]:
    """Autocovariances (k, k) of unit noise that lasts so long [s]; 0: white."""
    lag = np.abs(t[:, None] - t)
    return [np.exp(-lag / T) if T > 0 else np.eye(len(t)) for T in lasting]


def _oscillation(t: np.ndarray, f: float, T: float) -> np.ndarray:
    lag = np.abs(t[:, None] - t)
    return np.asarray(np.exp(-lag / T) * np.cos(2 * np.pi * f * lag))


def _frequency(hop: float, blocks: Sequence[Block]) -> float:
    """[Hz] where the mean spectrum stands out most of the nearest one that only falls."""
    P = np.zeros(SIZE + 1)
    for b in blocks:
        x = np.zeros(2 * SIZE)
        at = np.clip(np.round((b.t - b.t[0]) / hop).astype(int), 0, 2 * SIZE - 1)
        x[at] = b.residual * np.hanning(len(at))
        P += np.abs(np.fft.rfft(x)) ** 2
    f = np.fft.rfftfreq(2 * SIZE, hop)
    falling = scipy.optimize.isotonic_regression(P, increasing=False).x
    inside = (f > 4 / (SIZE * hop)) & (f < 0.4 / hop)
    return float(f[np.argmax(np.where(inside, P / np.maximum(falling, 1e-300), 0.0))])
