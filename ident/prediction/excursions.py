"""Where a log leaves the fit's band: stretches of any length whose errors noise does not explain.

All windows of 1, 2, 4, ... rows of a channel are looked at, by two statistics of the white residuals
(innovations.py): their energy, sum e^2 / var, which is chi-square, and their sum, which is normal; in both
the fit's uncertainty is part of the variance, in the sum with its full correlation. A window counts if it
passes both of two limits: the probability alpha divided by the number of windows and channels (Bonferroni),
so that a clean log is told to leave the band with probability alpha at most if residuals are as Gaussian as
the noise model takes them; and MARGIN times the largest value that identify and validate runs themselves ever
showed, so that what the model was always wrong by is no news. Strongest first; what overlaps a stronger
window is part of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.stats

from ident.prediction.innovations import Innovations

MARGIN = 1.5  # power over the worst of the fit's own windows


@dataclass(frozen=True, slots=True)
class Stretch:
    """Rows [first, last] of a channel that leave the band; strength: statistic over its limit, at least 1."""

    first: int
    last: int
    strength: float


def lengths(rows: int) -> list[int]:
    return [2**k for k in range(max(rows, 1).bit_length())]


def energies(
    found: Innovations, covariance: np.ndarray | None, length: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sum of e^2 / var, squared normal statistic of the sum, rows that count: of each window (m - L + 1,)."""
    var = found.variance.copy()
    if found.W is not None and covariance is not None:
        var += np.einsum("ij,jk,ik->i", found.W, covariance, found.W)
    z2 = np.where(found.used, found.e**2 / np.where(var > 0, var, 1.0), 0.0)
    total, drift = _windows(found.e * found.used, length), _windows(found.variance * found.used, length)
    if found.W is not None and covariance is not None:
        summed = _windows(found.W * found.used[:, None], length)
        drift = drift + np.einsum("ij,jk,ik->i", summed, covariance, summed)
    count = np.rint(_windows(found.used.astype(float), length)).astype(int)
    return _windows(z2, length), total**2 / np.where(drift > 0, drift, np.inf), count


def _windows(x: np.ndarray, length: int) -> np.ndarray:
    sums = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
    return sums[length:] - sums[:-length]


@dataclass(frozen=True, slots=True)
class OwnWorst:
    """The largest energy per row and squared sum statistic of the fit's own residuals, by window length."""

    energy: dict[int, float]
    total: dict[int, float]

    def limits(self, length: int) -> tuple[float, float]:
        known = [own for own in self.energy if own <= length] or list(self.energy) or [0]
        nearest = max(known)
        return self.energy.get(nearest, 0.0), self.total.get(nearest, 0.0)


def own_worst(runs: Sequence[Innovations]) -> OwnWorst:
    """Over the identify and validate runs of one channel."""
    energy: dict[int, float] = {}
    total: dict[int, float] = {}
    for run in runs:
        for length in lengths(len(run.e)):
            power, drift, count = energies(run, None, length)
            seen = 2 * count >= length
            if seen.any():
                energy[length] = max(energy.get(length, 0.0), float((power[seen] / count[seen]).max()))
                total[length] = max(total.get(length, 0.0), float(drift[seen].max()))
    return OwnWorst(energy, total)


def stretches(found: Innovations, covariance: np.ndarray, own: OwnWorst, alpha: float) -> tuple[Stretch, ...]:
    """Stretches of one channel in time order; alpha is what is left for this channel's windows together."""
    windows: list[tuple[float, int, int]] = []
    sizes = lengths(len(found.e))
    tests = 2 * sum(len(found.e) - length + 1 for length in sizes)
    for length in sizes:
        power, drift, count = energies(found, covariance, length)
        by_count = scipy.stats.chi2.isf(alpha / tests, np.maximum(np.arange(length + 1), 1))
        own_power, own_drift = own.limits(length)
        ratio = np.maximum(
            power / np.maximum(by_count[count], MARGIN * own_power * np.maximum(count, 1)),
            drift / max(float(scipy.stats.chi2.isf(alpha / tests, 1)), MARGIN * own_drift),
        )
        beyond = np.flatnonzero((ratio > 1) & (2 * count >= length))
        windows += [(float(ratio[k]), int(k), int(k + length - 1)) for k in beyond]
    return _joined(sorted(windows, key=lambda w: (-w[0], w[2] - w[1])))


def _joined(windows: Sequence[tuple[float, int, int]]) -> tuple[Stretch, ...]:
    """Strongest first; a window that overlaps one that is kept is part of it; near neighbours become one."""
    kept: list[Stretch] = []
    for strength, first, last in windows:
        if not any(first <= other.last and last >= other.first for other in kept):
            kept.append(Stretch(first, last, strength))
    out: list[Stretch] = []
    for stretch in sorted(kept, key=lambda s: s.first):
        gap = stretch.first - out[-1].last - 1 if out else 0
        if out and gap <= max(3, (max(out[-1].last - out[-1].first, stretch.last - stretch.first) + 1) // 2):
            out[-1] = Stretch(out[-1].first, stretch.last, max(out[-1].strength, stretch.strength))
        else:
            out.append(stretch)
    return tuple(out)
