"""How correlated the decimated residuals are, and what that does to standard deviations.

Eq. 15 takes rows as independent. Decimated rows are not quite: the filter leaves neighbours correlated,
friction and other model errors more so. A model of the correlation, autoregressive per channel, gives Omega
its true off-diagonal entries, and

    cov(chi) = Sigma (W' Omega_w^-1 Omega Omega_w^-1 W) Sigma,   Omega_w = diag(sigma_j^2)

is the covariance of the weighted estimate that the paper uses (a "sandwich", Davidson and MacKinnon 1993,
ch. 16). With Omega = L L', L^-1 is the banded matrix of prediction errors, so L' W costs one banded
solve.

Autocovariances are corrected for the parameters that were fitted: E rho rho' = (I - H) Omega (I - H)', to
first order Omega - H sigma^2, H the hat matrix; without it long memory is underestimated on short logs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.equations.observation import DecimatedSegment, RecordingSystem
from ident.estimation.least_squares import Estimate

MAX_ORDER = 12
BLOCK = 32  # rows that are solved for at once, at least as many as MAX_ORDER


@dataclass(frozen=True, slots=True)
class ChannelNoise:
    """Autoregressive noise of one channel: variance, coefficients (p,), rows and effective rows."""

    variance: float
    coefficients: np.ndarray  # rho[t] = sum_k coefficients[k] rho[t-1-k] + e[t]
    autocorrelation: np.ndarray  # (lags,) from lag 0, corrected
    rows: int

    @property
    def effective_rows(self) -> float:
        """rows * variance / spectral density at zero frequency (in the same units)."""
        prediction = self.variance * prediction_variances(self.coefficients, self.autocorrelation)[-1]
        density = prediction / max((1 - self.coefficients.sum()) ** 2, 1e-12)
        return float(self.rows * np.clip(self.variance / density, 1e-3, 1.0))


def channel_noises(systems: Sequence[RecordingSystem], estimate: Estimate) -> tuple[ChannelNoise, ...]:
    """One noise model per channel, pooled over the segments of all recordings given."""
    half = half_of(estimate)
    residuals = [system.residuals(estimate.chi) for system in systems]
    out = []
    for j, sigma in enumerate(estimate.sigma):
        lengths = [len(segment.t) for system in systems for segment in system.segments]
        rows = max(sum(int(segment.used[j].sum()) for system in systems for segment in system.segments), 1)
        longest = max(lengths)
        lags = int(max(1, min(MAX_ORDER, longest // 3, rows // 12)))
        sums, counts = np.zeros(lags + 1), np.zeros(lags + 1)
        for system, found in zip(systems, residuals):
            for segment, rho in zip(system.segments, found):
                for span, piece in segment.pieces(lags):
                    Z, used = _project(system, piece, j, half), piece.used[j]
                    its, own = rho[j, span.start : span.start + len(piece.t)], span.stop - span.start
                    for lag in range(min(lags, len(piece.t) - 1) + 1):
                        stop = min(own, len(piece.t) - lag)
                        after = slice(lag, lag + stop)
                        sums[lag] += its[:stop] @ its[after] + np.sum(Z[:stop] * Z[after])
                        counts[lag] += np.sum(used[:stop] & used[after])
        covariance = sums / np.maximum(counts, 1)
        variance = max(float(covariance[0]), 1e-30, 1e-12 * sigma**2)
        correlation = (
            covariance / variance * (counts / max(counts[0], 1))
        )  # tapered: keeps the sequence positive
        correlation[0] = 1.0
        out.append(ChannelNoise(variance, autoregression(correlation, rows), correlation, rows))
    return tuple(out)


def half_of(estimate: Estimate) -> np.ndarray:
    """A (b, k) with A A' = covariance."""
    columns = np.flatnonzero(estimate.active)
    values, vectors = np.linalg.eigh(estimate.covariance[np.ix_(columns, columns)])
    half = np.zeros((len(estimate.chi), len(columns)))
    half[columns] = vectors * np.sqrt(np.maximum(values, 0))
    return half


def _project(system: RecordingSystem, segment: DecimatedSegment, j: int, half: np.ndarray) -> np.ndarray:
    mine = system.channel == j
    return np.asarray(segment.values[mine].T @ half[system.column[mine]])


def autoregression(correlation: np.ndarray, rows: int) -> np.ndarray:
    """AR coefficients by Levinson and Durbin's recursion, the order by Akaike's criterion with a
    small-sample term."""
    best, chosen = np.inf, np.zeros(0)
    coefficients, error = np.zeros(0), 1.0
    for order in range(len(correlation)):
        if order:
            reflection = (
                (correlation[order] - coefficients @ correlation[order - 1 : 0 : -1]) / error
                if order > 1
                else correlation[1] / error
            )
            if abs(reflection) >= 0.999:
                break
            coefficients = np.append(coefficients - reflection * coefficients[::-1], reflection)
            error *= 1 - reflection**2
        criterion = rows * np.log(error) + 2 * order * rows / max(rows - order - 2, 1)
        if criterion < best:
            best, chosen = criterion, coefficients
    return chosen


def prediction_variances(coefficients: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Relative prediction error variances of orders 0..p."""
    return np.array([error for _, error in _orders(coefficients, correlation)])


def _orders(coefficients: np.ndarray, correlation: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Predictors of orders 0..p with their relative error variances (Levinson and Durbin)."""
    out: list[tuple[np.ndarray, float]] = [(np.zeros(0), 1.0)]
    current, error = np.zeros(0), 1.0
    for order in range(1, len(coefficients) + 1):
        reflection = (correlation[order] - current @ correlation[1:order][::-1]) / error
        current = np.append(current - reflection * current[::-1], reflection)
        error *= 1 - reflection**2
        out.append((current, error))
    return out


def colour(W: np.ndarray, noise: ChannelNoise) -> np.ndarray:
    """L' W (m, b) with L L' the correlation matrix of m consecutive rows of this noise."""
    p, m = len(noise.coefficients), len(W)
    if p == 0:
        return W
    predictors = _orders(noise.coefficients, noise.autocorrelation)
    errors = np.zeros((min(m, 2 * BLOCK), min(m, 2 * BLOCK)))  # A: prediction errors are A rho
    for t, row in enumerate(errors):
        a, error = predictors[min(t, p)]
        row[t - len(a) : t + 1] = np.append(-a[::-1], 1.0) / np.sqrt(error)
    # A' X = W gives X = L' W. A' is an upper band: the last block first, then what it leaves of those before,
    # which have the same rows, all but the first.
    first, other = (np.linalg.inv(errors[its, its].T) for its in (slice(0, BLOCK), slice(BLOCK, None)))
    reach = errors[BLOCK : BLOCK + p, :BLOCK].T
    out = np.empty(W.shape)
    for start in reversed(range(0, m, BLOCK)):
        its, after = slice(start, min(start + BLOCK, m)), out[start + BLOCK : start + BLOCK + p]
        left = W[its] - reach[:, : len(after)] @ after if len(after) else W[its]
        out[its] = (other if start else first)[: len(left), : len(left)] @ left
    return out


def honest_covariance(
    systems: Sequence[RecordingSystem],
    estimate: Estimate,
    noises: Sequence[ChannelNoise],
    turn: np.ndarray | None = None,
) -> np.ndarray:
    """Covariance (b, b) of the weighted estimate under the correlated noise of `noises`; `turn` (b, b): the
    columns that the estimate was solved on are those of `systems` times it."""
    half = half_of(estimate)
    across = half if turn is None else turn @ half
    middle = np.zeros((half.shape[1], half.shape[1]))
    for j, (sigma, noise) in enumerate(zip(estimate.sigma, noises)):
        for system in systems:
            for segment in system.segments:
                for _, piece in segment.pieces():  # its neighbours' correlation with it counts for nothing
                    X = colour(_project(system, piece, j, across), noise)
                    middle += X.T @ X * (noise.variance / sigma**4)
    return half @ middle @ half.T


def durbin_watson(sequences: Sequence[np.ndarray], used: Sequence[np.ndarray] | None = None) -> float:
    """Eq. 17 over normalised residuals (channels, m); differences are taken between neighbours that count."""
    above = below = 0.0
    for k, rho in enumerate(sequences):
        counts = np.ones(rho.shape, bool) if used is None else used[k]
        pairs = counts[:, 1:] & counts[:, :-1]
        above += float(np.sum(np.diff(rho, axis=1)[pairs] ** 2))
        below += float(np.sum(rho[counts] ** 2))
    return above / below if below > 0 else 2.0
