"""All parameters of a study from its equations: weighted least squares with the study's own options."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ident.equations.columns import Columns
from ident.equations.observation import ChannelFactor, RecordingSystem, stack
from ident.errors import FitFailedError
from ident.estimation.gains import estimate_with_gains
from ident.estimation.least_squares import Estimate, channel_sigma, huber_factors, weighted_least_squares
from ident.recordings.study import Study

HUBER_TURNS = 30


def estimate_all(
    systems: Sequence[RecordingSystem],
    study: Study,
    columns: Columns,
    allowed: np.ndarray | None = None,
    held: np.ndarray | None = None,
) -> tuple[Estimate, tuple[ChannelFactor, ...]]:
    """WLS of all base parameters on these recordings, with the study's options. -> estimate, factors used.

    allowed (b,) bool: parameters in the fit, the others stand at held (b,). Raises FitFailedError.
    """
    names, factors = columns.parameters, stack(systems)
    if columns.gain_columns:
        return estimate_with_gains(factors, columns), factors
    sigma = channel_sigma(factors)
    estimate = weighted_least_squares(factors, sigma, names, allowed, held)
    if study.robust == "huber":
        for _ in range(HUBER_TURNS):
            before = estimate.chi
            weighted, _ = huber_factors(systems, sigma, before)
            sigma = robust_sigma(systems, before)
            estimate = weighted_least_squares(weighted, sigma, names, allowed, held)
            if np.all(np.abs(estimate.chi - before) <= 1e-3 * np.maximum(estimate.std, 1e-12)):
                break
        factors, _ = huber_factors(systems, sigma, estimate.chi)
        estimate = weighted_least_squares(factors, sigma, names, allowed, held)
    if not estimate.active.any():
        raise FitFailedError("no parameter is excited by the identify recordings; record the robot moving")
    return estimate, factors


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
