"""All parameters of a study from its equations: weighted least squares with the study's own options."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ident.equations.columns import Columns
from ident.equations.observation import ChannelFactor, RecordingSystem, stack
from ident.errors import FitFailedError
from ident.estimation.estimators.recursive import faded_factors
from ident.estimation.estimators.reweighted import reweighted
from ident.estimation.gains import estimate_with_gains
from ident.estimation.least_squares import Estimate, channel_sigma, weighted_least_squares
from ident.recordings.study import Study


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
    names = columns.parameters
    factors = faded_factors(systems, study.forgetting) if study.forgetting else stack(systems)
    if columns.gain_columns:
        return estimate_with_gains(factors, columns), factors
    sigma = channel_sigma(factors)
    estimate = weighted_least_squares(factors, sigma, names, allowed, held)
    if study.robust == "huber" or study.estimator == "irls":
        estimate, factors = reweighted(systems, estimate, allowed, held)
    if not estimate.active.any():
        raise FitFailedError("no parameter is excited by the identify recordings; record the robot moving")
    return estimate, factors
