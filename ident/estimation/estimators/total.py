"""Total least squares of a drive gain: noise in the motor's signal and in the sensor's torque alike.

    tau = g i - W chi,   W exact, i and tau with noise of known deviations

Least squares takes the noise of i for a smaller gain. Mixed least and total squares (Golub and Van Loan, SIAM
J. Numer. Anal. 17, 1980; Van Huffel and Vandewalle 1991, ch. 3): W is eliminated by a QR factorisation, and
in what is left of [i tau], each over its deviation, the direction of least length is the relation sought.
"""

from __future__ import annotations

import numpy as np

from ident.errors import FitFailedError


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
