"""How long a motion has to last until a diagnosis decides between two explanations.

The log likelihood ratio has mean T s / 2 and variance T s after s seconds of rows that judge; it is beyond
what a diagnosis asks, tau, with probability 1 - alpha when sqrt(T s) = z + sqrt(z^2 + 2 tau), z the normal
quantile of 1 - alpha. A diagnosis asks enough of its blocks to agree as well; one with T_b does with the
probability Phi(sqrt(T_b) / 2). The rows that are fitted come on top.
"""

from __future__ import annotations

import numpy as np
import scipy.stats

from ident.diagnosis.evidence import BLOCK_S, FEWEST, rarely
from ident.diagnosis.loop import threshold

ALPHA = 0.01
PATIENCE = 3600.0  # s of motion that nobody asks of a robot; only words depend on it
LONGEST = 1e8  # s: what would need longer is never told apart


def seconds_needed(rates: np.ndarray, period: float, alpha: float = ALPHA) -> float:
    """s of a motion with T = rates (N,) per second along its period until a diagnosis decides, rightly in
    1 - alpha of all cases: by the likelihood, and by the blocks that agree."""
    rate, z = float(np.mean(rates)), scipy.stats.norm.isf(alpha)
    if not rate > 0:
        return float("inf")

    def agree(seconds: float) -> bool:
        length = min(BLOCK_S, seconds / FEWEST)
        blocks = round(seconds / length)
        pieces = np.array_split(rates, min(max(round(period / length), 1), len(rates)))
        each = scipy.stats.norm.cdf([np.sqrt(length * piece.mean()) / 2 for piece in pieces]).mean()
        chance = scipy.stats.binom.isf(rarely(blocks, alpha), blocks, 0.5)
        return bool(scipy.stats.binom.sf(chance, blocks, each) >= 1 - alpha)

    seconds = (z + np.sqrt(z * z + 2 * threshold(alpha))) ** 2 / rate
    while seconds < LONGEST and not agree(seconds):
        seconds *= 1.05
    return float(seconds) if seconds < LONGEST else float("inf")
