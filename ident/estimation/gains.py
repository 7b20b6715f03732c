"""Unknown drive gains: motor signals i_j in drive units, g_j i_j = W_j chi - Y0_j (Y0 = 0 in model C,
-tau_l in D).

With the column -i_j the equation is linear in chi and g, but least squares then has its noise (friction
that no model knows) among the regressors and shrinks g, to nothing on a joint that carries little torque.
So the error is taken in the motor signal, rho = g0 (i - (W chi - Y0) / g), and the fit is Gauss and
Newton's: linearised about (chi0, g0) the rows are

    W chi - i0 g = Y0 + g0 i - i0 g0,    i0 = (W chi0 - Y0) / g0   the modelled motor signal,

whose every column is a combination of the columns of the channel's R factor: no new pass over the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.equations.columns import Columns
from ident.equations.observation import ChannelFactor, triangular
from ident.errors import FitFailedError
from ident.estimation.least_squares import Estimate, channel_sigma, joint_sigma, weighted_least_squares

TURNS = 60


def estimate_with_gains(factors: Sequence[ChannelFactor], columns: Columns) -> Estimate:
    """WLS with unknown drive gains. Raises FitFailedError where a gain has no positive value."""
    chi, sigma = _start(factors, columns)
    estimate: Estimate | None = None
    for _ in range(TURNS):
        linear = [linearised(factor, columns, j, chi) for j, factor in enumerate(factors)]
        estimate = weighted_least_squares(linear, sigma, columns.parameters)
        sigma = joint_sigma(linear, estimate.chi, estimate.covariance, sigma)
        step = estimate.chi - chi
        gains = list(columns.gain_columns.values())
        largest = np.max(np.abs(step[gains]) / np.abs(chi[gains]))
        chi = chi + step * min(1.0, 0.5 / max(largest, 1e-12))  # at most half a gain at a time
        if largest < 1e-9:
            break
    assert estimate is not None
    for j, place in columns.gain_columns.items():
        if not estimate.chi[place] > 0:
            joint, signal = columns.need.joints[columns.joint_of[j]], columns.channels[j]
            raise FitFailedError(
                f"drive_gains: the gain of joint {joint} has no positive value: with these positions its "
                "motor signal does not go with the torques; check both, their signs first, or leave "
                f"{signal} out of channels:"
            )
    return estimate


def linearised(factor: ChannelFactor, columns: Columns, j: int, chi: np.ndarray) -> ChannelFactor:
    """The factor of channel j about chi; channels without a gain unchanged."""
    if j not in columns.gain_columns:
        return factor
    place = int(np.searchsorted(factor.columns, columns.gain_columns[j]))
    W, signal, Y0 = np.delete(factor.R[:, :-1], place, axis=1), -factor.R[:, place], factor.R[:, -1]
    others = np.delete(factor.columns, place)
    g0 = chi[columns.gain_columns[j]]
    modelled = (W @ chi[others] - Y0) / g0
    R = factor.R.copy()
    R[:, place] = -modelled
    R[:, -1] = Y0 + g0 * signal - modelled * g0
    return replace(factor, R=triangular(R))


def _start(factors: Sequence[ChannelFactor], columns: Columns) -> tuple[np.ndarray, np.ndarray]:
    """chi and sigma to begin with: the torque that the sensors explain, then each motor signal regressed on
    it."""
    b = len(columns.parameters)
    chi, sigma = np.zeros(b), np.ones(len(factors))
    sensors = [j for j in range(len(factors)) if j not in columns.gain_columns]
    if columns.need.model == "A":
        return _start_from_payload(factors, columns)
    if sensors:
        part = [factors[j] for j in sensors]
        sigma[sensors] = channel_sigma(part)
        chi = weighted_least_squares(part, sigma[sensors], columns.parameters).chi
    for j, gain in columns.gain_columns.items():
        factor = factors[j]
        shared = np.zeros(len(factor.columns), bool)
        if sensors:
            shared = np.isin(factor.columns, np.concatenate([factors[k].columns for k in sensors]))
        own = ~shared & (factor.columns != gain)
        signal = -factor.R[:, int(np.searchsorted(factor.columns, gain))]
        torque = factor.R[:, :-1][:, shared] @ chi[factor.columns[shared]] - factor.R[:, -1]
        W = np.column_stack([torque, factor.R[:, :-1][:, own]])
        scale = np.maximum(np.linalg.norm(W, axis=0), 1e-300)
        found = np.linalg.lstsq(W / scale, signal, rcond=1e-9)[0] / scale
        g = (
            1 / found[0]
            if found[0] > 0
            else np.linalg.norm(torque) / max(float(np.linalg.norm(signal)), 1e-300)
        )
        chi[gain] = g
        chi[factor.columns[own]] = found[1:] * g
        left = signal - W @ found
        sigma[j] = g * max(float(np.linalg.norm(left)), 1e-12) / np.sqrt(max(factor.rows - W.shape[1], 1))
    return chi, sigma


def _start_from_payload(factors: Sequence[ChannelFactor], columns: Columns) -> tuple[np.ndarray, np.ndarray]:
    """Without a sensor: plain least squares of 0 = W chi - g i - Y0; a quiet signal biases it little.

    A weighed payload is the only scale; joints that do not feel it are tied to it by the links they share.
    """
    sigma = np.ones(len(factors))
    for _ in range(4):
        estimate = weighted_least_squares(factors, sigma, columns.parameters)
        sigma = joint_sigma(factors, estimate.chi, estimate.covariance, sigma)
    chi = estimate.chi.copy()
    gains = list(columns.gain_columns.values())
    positive = chi[gains][chi[gains] > 0]
    if not len(positive):
        raise FitFailedError(
            "drive_gains: the weighed payload moves too little to give the torques a scale; "
            "record it at more postures"
        )
    chi[gains] = np.where(chi[gains] > 0, chi[gains], np.median(positive))
    return chi, sigma
