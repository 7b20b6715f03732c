"""Residuals made white: what of each decimated row its predecessors, and the fit's own doubt, do not explain.

    e_t = rho_t - sum_k a_k rho_(t-k),     var e_t = sigma^2 pi_k + (w_t - sum a_k w_(t-k))' Sigma (...)

with the autoregressive noise of the fit (estimation/noise.py) and the covariance Sigma of its parameters.
After a row that does not count (a joint at rest) the predictor starts anew, one order a row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.estimation.noise import ChannelNoise


@dataclass(frozen=True, slots=True)
class Innovations:
    """One channel: e (m,) N m, variance (m,) of the noise alone, W (m, b) filtered alike, used (m,) bool."""

    e: np.ndarray
    variance: np.ndarray
    W: np.ndarray | None
    used: np.ndarray


def innovations(
    rho: np.ndarray, used: np.ndarray, noise: ChannelNoise, W: np.ndarray | None = None
) -> Innovations:
    """White a channel's rows rho (m,); rows that are not used are zero and stay out."""
    predictors = _predictors(noise)
    before = np.zeros(len(rho), int)  # used rows without a break before each row
    for t in range(1, len(rho)):
        before[t] = before[t - 1] + 1 if used[t - 1] else 0
    order = np.minimum(before, len(predictors) - 1)
    e, variance = np.where(used, rho, 0.0), np.zeros(len(rho))
    white = None if W is None else W.copy()
    for k, (coefficients, error) in enumerate(predictors):
        rows = np.flatnonzero(used & (order == k))
        variance[rows] = noise.variance * error
        for lag, a in enumerate(coefficients, 1):
            e[rows] -= a * rho[rows - lag]
            if white is not None and W is not None:
                white[rows] -= a * W[rows - lag]
    return Innovations(e, variance, white, used)


def _predictors(noise: ChannelNoise) -> Sequence[tuple[np.ndarray, float]]:
    """Coefficients and relative error variance of orders 0..p (Levinson and Durbin)."""
    out: list[tuple[np.ndarray, float]] = [(np.zeros(0), 1.0)]
    current, error = np.zeros(0), 1.0
    for order in range(1, len(noise.coefficients) + 1):
        reflection = (noise.autocorrelation[order] - current @ noise.autocorrelation[1:order][::-1]) / error
        current = np.append(current - reflection * current[::-1], reflection)
        error *= 1 - reflection**2
        out.append((current, error))
    return out
