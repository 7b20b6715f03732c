"""Fits from windows alone: least squares on merged factors, deviations that know of correlated residuals.

Rows of a summary are gone, so the covariance of correlated noise (noise.py) is taken by its one number that
matters for slow columns, the spectral density at zero over the variance, f_j = rows / effective rows:

    cov(chi) = Sigma (sum_j f_j / sigma_j^2 R_j' R_j) Sigma
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.estimation.least_squares import Estimate, channel_sigma, weighted_least_squares
from ident.estimation.noise import MAX_ORDER, ChannelNoise, autoregression
from ident.summaries.window import Window, added


@dataclass(frozen=True, slots=True)
class SummaryFit:
    """All base parameters of merged windows: estimate (covariance as eq. 15), honest covariance (b, b),
    relative error in percent (C,), noise of each channel."""

    estimate: Estimate
    covariance: np.ndarray
    error_percent: np.ndarray
    noises: tuple[ChannelNoise, ...]

    @property
    def std(self) -> np.ndarray:
        """(b,); NaN where the motion shows nothing of a parameter."""
        return np.where(self.estimate.active, np.sqrt(np.diag(self.covariance)), np.nan)

    @property
    def values(self) -> np.ndarray:
        """chi (b,); NaN where the motion shows nothing of a parameter."""
        return np.where(self.estimate.active, self.estimate.chi, np.nan)


def fit_window(window: Window, parameters: tuple[str, ...]) -> SummaryFit:
    """Weighted least squares of one window or of a sum of them. Raises NotEnoughDataError."""
    estimate = weighted_least_squares(window.factors, channel_sigma(window.factors), parameters)
    noises = tuple(_noise(*sums) for sums in zip(window.products, window.counts))
    middle = np.zeros_like(estimate.covariance)
    errors = []
    for factor, sigma, noise in zip(window.factors, estimate.sigma, noises):
        W = factor.R[:, :-1] / sigma
        spread = max(noise.rows, 1) / max(noise.effective_rows, 1e-12)
        middle[np.ix_(factor.columns, factor.columns)] += spread * (W.T @ W)
        size = float(np.linalg.norm(factor.R[:, -1]))
        errors.append(100 * np.sqrt(factor.sum_of_squares(estimate.chi)) / max(size, 1e-300))
    covariance = estimate.covariance @ middle @ estimate.covariance
    return SummaryFit(estimate, covariance, np.array(errors), noises)


def _noise(products: np.ndarray, counts: np.ndarray) -> ChannelNoise:
    rows = int(counts[0])
    lags = int(max(1, min(MAX_ORDER, rows // 12)))
    variance = max(float(products[0]) / max(rows, 1), 1e-30)
    correlation = products[: lags + 1] / max(float(products[0]), 1e-30)  # over all rows: tapered
    correlation = np.where(np.arange(lags + 1) == 0, 1.0, correlation)
    return ChannelNoise(variance, autoregression(correlation, max(rows, 1)), correlation, rows)


def recursive(
    windows: Sequence[Window], parameters: tuple[str, ...], forgetting: float = 1.0
) -> Iterator[tuple[Window, SummaryFit]]:
    """The estimate after each window in order, what came before weighing `forgetting` less each time.

    Recursive least squares in its square-root form: R <- qr([sqrt(forgetting) R; R_new]).
    """
    if not 0 < forgetting <= 1:
        raise ValueError(f"forgetting is {forgetting:g}; give a share above 0 and up to 1")
    so_far: Window | None = None
    for window in sorted(windows, key=lambda each: each.key):
        so_far = window if so_far is None else added(faded(so_far, forgetting), window)
        yield window, fit_window(so_far, parameters)


def faded(window: Window, share: float) -> Window:
    """A window whose rows weigh `share` of what they did."""
    factors = tuple(
        replace(factor, R=factor.R * np.sqrt(share), rows=round(factor.rows * share))
        for factor in window.factors
    )
    return replace(window, factors=factors, products=window.products * share, counts=window.counts * share)
