"""Instrumental variables, and whether they are needed: the test of Durbin, Wu and Hausman.

    chi = (W' P W)^-1 W' P Y,   P = Z (Z'Z)^-1 Z'

In a closed loop noise of the torque reaches the positions, W is correlated with rho and least squares is
biased; a regressor Z of simulated, noise-free motion is not (IDIM-IV: Janot, Vandanjon and Gautier, IEEE
Trans. Control Syst. Technol. 22, 2014). Both estimates and the test follow from one factor of [Z W Y]: what Z
does not explain of W stands below Z's rows, orthogonal to what it does. The test adds that part to the
regression (Wu 1973): its F-statistic is large where least squares is biased.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident import distributions
from ident.equations.observation import RecordingSystem, triangular
from ident.errors import NotEnoughDataError
from ident.estimation.estimators.simulated import Loop
from ident.estimation.least_squares import Estimate, solve
from ident.progress import Progress, silent

DEPENDENT = 1e-9  # singular value, relative: below it there is no more rank
TURNS = 5
STILL = 0.2  # standard deviations: a smaller step is none


@dataclass(frozen=True, slots=True)
class Instrumental:
    """chi, std (b,) by instruments, least_squares (b,) beside it; F-test of "least squares is unbiased".

    R (b + 1, b + 1): factor whose least squares is chi, its rss that of Y - W chi; T (b, b): P W = Z T.
    """

    chi: np.ndarray
    std: np.ndarray
    least_squares: np.ndarray
    statistic: float
    df_num: int
    df_den: int
    R: np.ndarray
    T: np.ndarray

    @property
    def p_value(self) -> float:
        return distributions.f_beyond(self.statistic, self.df_num, self.df_den)


def most_shifted(found: Instrumental, first: Estimate, std: np.ndarray) -> tuple[str, float]:
    """The parameter that instruments move most from the least squares estimate `first` with honest deviations
    std (b,), and by how many of them."""
    active = np.flatnonzero(first.active)
    shift = (found.chi - first.chi[active]) / np.maximum(std[active], 1e-300)
    most = int(np.argmax(np.abs(shift)))
    return first.parameters[active[most]], float(shift[most])


def instrumental(R: np.ndarray, instruments: int, rows: int, share: float = 1.0) -> Instrumental:
    """R: triangular factor of [Z W Y] with `instruments` columns Z, made of `rows` rows of which `share`
    count (correlated ones repeat each other).

    Raises NotEnoughDataError where the instruments do not determine every parameter.
    """
    explained, left = R[:instruments, instruments:], R[instruments:, instruments:]
    b = explained.shape[1] - 1
    scale = np.linalg.norm(R[:, instruments:-1], axis=0)
    scale[scale == 0] = 1.0
    PW, W = explained[:, :-1] / scale, R[:, instruments:-1] / scale
    Z = R[:instruments, :instruments]
    length = np.linalg.norm(Z, axis=0)
    full = np.linalg.matrix_rank(Z / np.where(length > 0, length, 1.0), rtol=DEPENDENT) == instruments
    if not full or np.linalg.matrix_rank(PW, rtol=DEPENDENT) < b or rows <= 2 * b:
        raise NotEnoughDataError("the instruments do not determine every parameter; move more, or fit fewer")
    chi, above = _solved(PW, explained[:, -1])
    plain, restricted = _solved(W, R[:, -1])
    _, below = _solved(left[:, :-1] / scale, left[:, -1])
    added = np.linalg.matrix_rank(left[:, :-1] / scale, rtol=DEPENDENT)
    free = rows - b - added
    statistic = max(restricted - above - below, 0.0) / max(added, 1) / max((above + below) / free, 1e-300)
    rss = float(np.sum((R[:, -1] - W @ chi) ** 2))
    half = np.linalg.pinv(PW)
    std = np.sqrt(rss / (rows - b) * np.sum(half**2, axis=1))
    last = np.append(np.zeros(b), np.sqrt(max(rss - above, 0.0)))
    return Instrumental(
        chi / scale,
        std / scale,
        plain / scale,
        statistic * share,
        int(added),
        max(int(share * free), 1),
        triangular(np.vstack([explained, last])),
        np.linalg.lstsq(Z, explained[:, :-1], rcond=None)[0],
    )


def _solved(A: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    x, *_ = np.linalg.lstsq(A, y, rcond=DEPENDENT)
    return x, float(np.sum((y - A @ x) ** 2))


def by_instruments(
    loop: Loop,
    systems: Sequence[RecordingSystem],
    first: Estimate,
    share: float,
    progress: Progress = silent,
    turns: int = TURNS,
) -> tuple[Estimate, tuple[RecordingSystem, ...], Instrumental, np.ndarray]:
    """IDIM-IV from a first estimate. -> the estimate, the instruments' equations, the test, T (b, b).

    Raises FitFailedError where the loop cannot be simulated, NotEnoughDataError.
    """
    estimate, active = first, np.flatnonzero(first.active)
    for _ in range(turns):
        instruments = loop.systems(estimate.chi, progress)
        R, rows = _factor(instruments, systems, first.sigma, active)
        found = instrumental(R, len(active), rows, share)
        before, estimate = estimate.chi, _estimate(found, first, active, rows)
        if np.all(np.abs(estimate.chi - before) <= STILL * np.maximum(estimate.std, 1e-300)):
            break
    T = np.zeros((len(first.chi), len(first.chi)))
    T[np.ix_(active, active)] = found.T
    return estimate, instruments, found, T


def _factor(
    instruments: Sequence[RecordingSystem],
    systems: Sequence[RecordingSystem],
    sigma: np.ndarray,
    active: np.ndarray,
) -> tuple[np.ndarray, int]:
    """Triangular factor of [Z W Y] over the channels' deviations sigma, and its rows."""
    R, rows = np.zeros((0, 2 * len(active) + 1)), 0
    for Z, W in zip(instruments, systems):
        for one, other in zip(Z.segments, W.segments, strict=True):
            for (_, z), (_, w) in zip(one.pieces(), other.pieces(), strict=True):
                for j, deviation in enumerate(sigma):
                    used = w.used[j]
                    parts = [each.dense(piece, j, int(active[-1]) + 1)[used][:, active]
                             for each, piece in ((Z, z), (W, w))]  # fmt: skip
                    R = triangular(np.vstack([R, np.column_stack([*parts, w.Y[j, used]]) / deviation]))
                    rows += int(used.sum())
    return R, rows


def _estimate(found: Instrumental, first: Estimate, active: np.ndarray, rows: int) -> Estimate:
    """As an estimate whose factor restrictions and tests can be solved on."""
    b = len(first.chi)
    R = np.zeros((len(found.R), b + 1))
    R[:, [*active, b]] = found.R
    chi, covariance, rss = solve(R, first.active)
    return replace(first, chi=chi, covariance=covariance, R=R, rss=rss, rows=rows)
