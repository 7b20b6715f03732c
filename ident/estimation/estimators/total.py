"""Total least squares of a drive gain: noise in the motor's signal and in the sensor's torque alike.

    tau = g i - W chi,   W exact, i and tau with noise of known deviations

Least squares takes the noise of i for a smaller gain. Mixed least and total squares (Golub and Van Loan, SIAM
J. Numer. Anal. 17, 1980; Van Huffel and Vandewalle 1991, ch. 3): W is eliminated by a QR factorisation, and
in what is left of [i tau], each over its deviation, the direction of least length is the relation sought.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.equations.observation import ChannelFactor, triangular
from ident.equations.prepared import Prepared
from ident.errors import FitFailedError, StudyError
from ident.estimation.least_squares import Estimate, joint_sigma, weighted_least_squares
from ident.signals.low_pass import MAX_SHARE, zero_phase

NOISE_ROWS = 16000  # samples of each recording from which noise is estimated


def gain_and_parameters(
    R: np.ndarray, signal: int, noise: tuple[float, float]
) -> tuple[float, np.ndarray, float]:
    """R: triangular factor of [W tau] where column `signal` of W is -i; noise: deviations of i and tau.

    -> g, chi of the other columns, and the length that is left (its square over the rows is 1 where the noise
    is as stated). Raises FitFailedError where no finite gain fits.
    """
    exact = np.delete(np.arange(R.shape[1] - 1), signal)
    ordered = np.asarray(np.linalg.qr(np.column_stack([R[:, exact], -R[:, signal], R[:, -1]]), mode="r"))
    k = len(exact)
    below = ordered[k:, k:] / np.array(noise)
    _, singular, V = np.linalg.svd(below)
    direction = V[-1] / np.array(noise)
    if abs(direction[1]) < 1e-12 * abs(direction[0]):
        raise FitFailedError("the motor's signal does not move the torque; record both while the joint moves")
    g = -direction[0] / direction[1]
    right = ordered[:k, k + 1] - g * ordered[:k, k]
    chi = np.linalg.solve(ordered[:k, :k], -right)
    return float(g), chi, float(singular[-1])


def total_least_squares(prepared: Prepared, factors: Sequence[ChannelFactor], first: Estimate) -> Estimate:
    """Gains and friction of model D, channel by channel; the deviations of i and tau are those of what lies
    above the positions' cut-off in the identify recordings. Raises FitFailedError, StudyError."""
    columns, chi = prepared.columns, first.chi.copy()
    linear = []
    for j, (factor, noise) in enumerate(zip(factors, signal_noises(prepared))):
        joint = columns.need.joints[columns.joint_of[j]]
        place = int(np.searchsorted(factor.columns, columns.gain_columns[j]))
        R = np.column_stack([factor.R[:, :-1], -factor.R[:, -1]])  # tau = g i - W chi
        seen = np.linalg.norm(R[:, :-1], axis=0) > 1e-12 * np.linalg.norm(R)
        if not seen[place]:
            raise FitFailedError(f"drive_gains: no current flows in joint {joint}")
        g, others, _ = gain_and_parameters(R[:, np.append(seen, True)], int(seen[:place].sum()), noise)
        if not g > 0:
            raise FitFailedError(
                f"drive_gains: the gain of joint {joint} has no positive value; check the "
                "signs of its motor signal and its torque sensor"
            )
        chi[factor.columns[seen]] = np.insert(others, int(seen[:place].sum()), g)
        linear.append(about(factor, place, chi[factor.columns], noise))
    sigma = joint_sigma(linear, chi, first.covariance, first.sigma)
    return weighted_least_squares(linear, sigma, columns.parameters, first.active)


def about(factor: ChannelFactor, place: int, chi: np.ndarray, noise: tuple[float, float]) -> ChannelFactor:
    """The factor with the signal's own noise taken out, whose least squares is the total one.

    At chi the residual is e = Y - W chi, and i0 = i - g s_i^2 / (g^2 s_i^2 + s_tau^2) e the likeliest true
    signal; e is orthogonal to W and to i0.
    """
    g, s_i, s_tau = chi[place], *noise
    e = factor.R[:, -1] - factor.R[:, :-1] @ chi
    R = factor.R.copy()
    R[:, place] -= -g * s_i**2 / (g**2 * s_i**2 + s_tau**2) * e  # the column is -i
    R[:, -1] = e + R[:, :-1] @ chi
    return replace(factor, R=triangular(R))


def signal_noises(prepared: Prepared) -> list[tuple[float, float]]:
    """(deviation of the motor's signal, of the sensor's torque) of each channel. Raises StudyError."""
    study, need = prepared.study, prepared.columns.need
    motor, sensor = [], []
    for stream in prepared.streams:
        cutoff = study.filter.position_cutoff_hz
        if stream.role != "identify":
            continue
        if cutoff >= 0.5 * MAX_SHARE * stream.rate_hz:
            raise StudyError(
                str(study.file),
                "estimator",
                f"tls compares the noise of currents and torques above the positions' cut-off, which "
                f"{stream.label}, at {stream.rate_hz:.4g} Hz, does not hold; write estimator: wls",
            )
        rows = []
        for _, blocks in stream.segments():
            for block in blocks:
                rows.append(block)
                if sum(map(len, rows)) > NOISE_ROWS:
                    break
            break
        values = np.concatenate(rows)
        high = values - zero_phase(values, stream.rate_hz, cutoff, study.filter.order)
        _, i, tau = stream.split(np.sqrt(np.mean(high**2, axis=0))[None])
        assert i is not None and tau is not None  # model D has both
        motor.append(i[0])
        sensor.append(tau[0])
    i, tau = np.mean(motor, axis=0), np.mean(sensor, axis=0)
    out = []
    for channel in need.channels:
        pair = float(i[need.motor.index(channel.joint)]), float(tau[need.sensor.index(channel.joint)])
        if not min(pair) > 0:
            raise StudyError(
                str(study.file),
                "estimator",
                f"tls weighs the noise of currents against that of torques, and joint "
                f"{need.joints[channel.joint]} has none in one of them; write estimator: wls",
            )
        out.append(pair)
    return out
