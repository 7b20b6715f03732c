"""The number times some torques with which recordings are explained best: on a grid, then between its best
one's neighbours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ident.examination.fits.quick import Assignment, Quick

GRID = np.geomspace(1e-5, 1e5, 31)
FINER, TIMES = 9, 3  # of them between the neighbours of the best one, so often


@dataclass(frozen=True, slots=True)
class BestFactor:
    """The factor, its gain, and that of an absurd one, by which torques and all others say nothing of each
    other."""

    factor: float
    gain: float
    absurd: float


def best_factor(gains: Callable[[np.ndarray], Sequence[float]]) -> BestFactor:
    """gains: of factors (K,)."""
    factors, gained = GRID, np.array(gains(GRID))
    absurd = float(max(gained[0], gained[-1]))
    for _ in range(TIMES):
        best = int(np.argmax(gained))
        low, high = factors[max(best - 1, 0)], factors[min(best + 1, len(factors) - 1)]
        factors = np.geomspace(low, high, FINER)
        gained = np.array(gains(factors))
    best = int(np.argmax(gained))
    return BestFactor(float(factors[best]), float(gained[best]), absurd)


def factor_of(quick: Quick, how: Assignment, channels: Sequence[int]) -> BestFactor:
    """That of torques of all recordings, by what is fitted."""
    before = quick.fit(how)
    return best_factor(
        lambda factors: [
            fit.gain_over(before) for fit in quick.fits([how.times(channels, f) for f in factors])
        ]
    )
