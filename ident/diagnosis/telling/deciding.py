"""How long a motion has to last until a diagnosis decides between two explanations.

The log likelihood ratio has mean T s / 2 and variance T s after s seconds of rows that judge; it is beyond
what a diagnosis asks, tau, with probability 1 - alpha when sqrt(T s) = z + sqrt(z^2 + 2 tau), z the normal
quantile of 1 - alpha. A diagnosis asks enough of its blocks to agree as well; one with T_b does with the
probability Phi(sqrt(T_b) / 2). The rows that are fitted come on top.

Rows that judge already go on judging. By what they are ahead less is asked, or more; once the model's own
parameters are known from what comes, they say more than they did alone, and their blocks count with the new
ones. Either explanation may be true; given what has been seen, the first one is with the odds e^ahead, and
each way round gets its share of the cases that may go wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.stats

from ident.diagnosis.evidence.blocks import BLOCK_S, FEWEST, rarely
from ident.diagnosis.outcome import threshold

ALPHA = 0.01
PATIENCE = 3600.0  # s of motion that nobody asks of a robot; only words depend on it
LONGEST = 1e8  # s: what would need longer is never told apart
LEAST = 1e-3  # of a motion's period
STEP, LEAP = 1.05, 8  # from one number of seconds to the next that is tried; so many of these at once


@dataclass(frozen=True)
class SoFar:
    """What rows that judge already say of two explanations: the nats of log E by which the first is ahead;
    for either one being true T per second in equal parts of their `seconds`, beside a motion that settles
    what the two have in common, and T of them alone."""

    ahead: float = 0.0
    rates: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    alone: tuple[float, float] = (0.0, 0.0)
    seconds: float = 0.0

    @property
    def other_way(self) -> SoFar:
        return SoFar(-self.ahead, self.rates[::-1], self.alone[::-1], self.seconds)

    @property
    def more(self) -> float:
        """T that the rows get, the first one being true, by what comes after them."""
        each = self.rates[0]
        return max(self.seconds * sum(each) / max(len(each), 1) - self.alone[0], 0.0)


NOTHING = SoFar()


def seconds_needed(
    rates: np.ndarray, period: float, alpha: float = ALPHA, so_far: SoFar = NOTHING, wrong: float = ALPHA
) -> float:
    """s of a motion with T = rates (N,) per second along its period until a diagnosis of the rate alpha
    decides for the first of two explanations, which is true, in 1 - wrong of all cases: by the likelihood,
    and by the blocks that agree."""
    rate, missing = float(np.mean(rates)), threshold(alpha) - so_far.ahead
    if not rate > 0:
        return float("inf")
    if wrong >= 1:
        return 0.0
    z = scipy.stats.norm.isf(wrong)

    def likely(seconds: float) -> bool:
        """Where the limit was passed already what comes may yet lead back."""
        T = rate * seconds + so_far.more
        return bool(T / 2 - missing >= z * np.sqrt(T) * (1 - 1e-9))

    def agree(seconds: float) -> bool:
        length = min(BLOCK_S, (seconds + so_far.seconds) / FEWEST)
        before, blocks = round(so_far.seconds / length), round(seconds / length)
        count = min(max(round(period / length), 1), len(rates))
        agreeing = blocks * _agreeing(_means(rates, count), length)
        if before:
            agreeing += before * _agreeing(np.array(so_far.rates[0]), length)
        blocks += before
        chance = scipy.stats.binom.isf(rarely(blocks, alpha), blocks, 0.5)
        return bool(scipy.stats.binom.sf(chance, blocks, agreeing / max(blocks, 1)) >= 1 - wrong)

    least = z + np.sqrt(z * z + 2 * missing) if missing > 0 else 0.0
    first = max((least**2 - so_far.more) / rate, LEAST * period)
    if first >= LONGEST:
        return float("inf")
    at = np.arange(np.floor(np.log(first / period) / np.log(STEP)), np.log(LONGEST / period) / np.log(STEP))
    tried = np.append(np.maximum(period * STEP**at, first), np.inf)  # the same steps for every motion
    enough = next(k for k in range(0, len(tried) + LEAP, LEAP) if _holds(tried, k, likely, agree))
    close = range(max(enough - LEAP + 1, 0), enough)
    return float(
        tried[min(next((k for k in close if _holds(tried, k, likely, agree)), enough), len(tried) - 1)]
    )


def _holds(tried: np.ndarray, k: int, *asked: Callable[[float], bool]) -> bool:
    """Whether so many seconds do; what is beyond the last does."""
    return k >= len(tried) - 1 or all(holds(float(tried[k])) for holds in asked)


def _means(rates: np.ndarray, count: int) -> np.ndarray:
    """(count,) of as many parts, next to equally long."""
    begin = np.arange(count) * len(rates) // count
    return np.asarray(np.add.reduceat(rates, begin) / np.diff(np.append(begin, len(rates))))


def _agreeing(rates: np.ndarray, length: float) -> float:
    """The share of blocks of that length [s] that are expected to agree, of T per second in each."""
    return float(scipy.stats.norm.cdf(np.sqrt(length * rates) / 2).mean())


def seconds_either_way(
    ways: Sequence[np.ndarray | None], period: float, so_far: SoFar = NOTHING, alpha: float = ALPHA
) -> float:
    """s until a diagnosis decides between two explanations, rightly in 1 - alpha of all cases: of either T
    per second (N,) along the period where it is true, None where what is seen cannot contradict the other."""
    odds = 1 / (1 + np.exp(-np.clip((so_far.ahead, -so_far.ahead), -500, 500)))
    asked = [
        (rates, its, float(share))
        for rates, its, share in zip(ways, (so_far, so_far.other_way), odds)
        if rates is not None
    ]
    if len(asked) == 1:  # only this one being true can be told
        return seconds_needed(asked[0][0], period, alpha, asked[0][1], alpha)
    each = [
        seconds_needed(rates, period, alpha, its, alpha / max(len(asked) * share, 1e-300))
        for rates, its, share in asked
    ]
    return max(each, default=float("inf"))
