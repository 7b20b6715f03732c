"""Iteratively reweighted least squares (`estimator: irls` or `robust: huber`): Huber's weights.

w = min(1, 1.345 sigma_j / |rho|),   sigma_j = 1.4826 median |rho|      (Huber 1981)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ident.equations.observation import ChannelFactor, RecordingSystem
from ident.estimation.least_squares import Estimate, huber_factors, weighted_least_squares

TURNS = 30


def reweighted(
    systems: Sequence[RecordingSystem],
    estimate: Estimate,
    allowed: np.ndarray | None = None,
    held: np.ndarray | None = None,
) -> tuple[Estimate, tuple[ChannelFactor, ...]]:
    """From a first estimate to one that outliers move little, and the factors with its weights."""
    names, sigma = estimate.parameters, estimate.sigma
    for _ in range(TURNS):
        before = estimate.chi
        weighted, _ = huber_factors(systems, sigma, before)
        sigma = robust_sigma(systems, before)
        estimate = weighted_least_squares(weighted, sigma, names, allowed, held)
        if np.all(np.abs(estimate.chi - before) <= 1e-3 * np.maximum(estimate.std, 1e-12)):
            break
    factors, _ = huber_factors(systems, sigma, estimate.chi)
    return weighted_least_squares(factors, sigma, names, allowed, held), factors


def robust_sigma(systems: Sequence[RecordingSystem], chi: np.ndarray) -> np.ndarray:
    """sigma_j from the median of |rho| (1.4826 MAD), which outliers do not move; rows at rest are none."""
    out = np.full(len(systems[0].factors), np.nan)
    for j in range(len(out)):
        rho = [
            part[j, segment.used[j]]
            for system in systems
            for segment, part in zip(system.segments, system.residuals(chi))
        ]
        joined = np.concatenate(rho)
        if len(joined):
            out[j] = 1.4826 * np.median(np.abs(joined))
    return np.maximum(np.where(np.isnan(out), np.nanmean(out), out), 1e-9)
