"""Instrumental variables, and whether they are needed: the test of Durbin, Wu and Hausman.

    chi = (W' P W)^-1 W' P Y,   P = Z (Z'Z)^-1 Z'

In a closed loop noise of the torque reaches the positions, W is correlated with rho and least squares is
biased; a regressor Z of simulated, noise-free motion is not (IDIM-IV: Janot, Vandanjon and Gautier, IEEE
Trans. Control Syst. Technol. 22, 2014). Both estimates and the test follow from one factor of [Z W Y]: what Z
does not explain of W stands below Z's rows, orthogonal to what it does. The test adds that part to the
regression (Wu 1973): its F-statistic is large where least squares is biased.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.special

from ident.errors import NotEnoughDataError

DEPENDENT = 1e-9  # singular value, relative: below it there is no more rank


@dataclass(frozen=True, slots=True)
class Instrumental:
    """chi, std (b,) by instruments, least_squares (b,) beside it; F-test of "least squares is unbiased"."""

    chi: np.ndarray
    std: np.ndarray
    least_squares: np.ndarray
    statistic: float
    df_num: int
    df_den: int

    @property
    def p_value(self) -> float:
        return float(scipy.special.fdtrc(self.df_num, self.df_den, self.statistic))

    def sentence(self, alpha: float = 0.01) -> str:
        """The finding, "" where there is none."""
        if self.p_value >= alpha:
            return ""
        return (
            f"the least squares estimate is biased by feedback (Durbin, Wu and Hausman: "
            f"p = {self.p_value:.2g}); use iv"
        )


def instrumental(R: np.ndarray, instruments: int, rows: int) -> Instrumental:
    """R: triangular factor of [Z W Y] with `instruments` columns Z, made of `rows` rows.

    Raises NotEnoughDataError where the instruments do not determine every parameter.
    """
    explained, left = R[:instruments, instruments:], R[instruments:, instruments:]
    b = explained.shape[1] - 1
    scale = np.linalg.norm(R[:, instruments:-1], axis=0)
    scale[scale == 0] = 1.0
    PW, W = explained[:, :-1] / scale, R[:, instruments:-1] / scale
    Z = R[:instruments, :instruments]
    full = np.linalg.matrix_rank(Z, rtol=DEPENDENT) == instruments
    if not full or np.linalg.matrix_rank(PW, rtol=DEPENDENT) < b or rows <= 2 * b:
        raise NotEnoughDataError("the instruments do not determine every parameter; move more, or fit fewer")
    chi, above = _solved(PW, explained[:, -1])
    plain, restricted = _solved(W, R[:, -1])
    _, below = _solved(left[:, :-1] / scale, left[:, -1])
    added = np.linalg.matrix_rank(left[:, :-1] / scale, rtol=DEPENDENT)
    free = rows - b - added
    statistic = max(restricted - above - below, 0.0) / max(added, 1) / max((above + below) / free, 1e-300)
    spread = float(np.sum((R[:, -1] - W @ chi) ** 2)) / (rows - b)
    half = np.linalg.pinv(PW)
    std = np.sqrt(spread * np.sum(half**2, axis=1))
    return Instrumental(chi / scale, std / scale, plain / scale, statistic, int(added), int(free))


def _solved(A: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    x, *_ = np.linalg.lstsq(A, y, rcond=DEPENDENT)
    return x, float(np.sum((y - A @ x) ** 2))
