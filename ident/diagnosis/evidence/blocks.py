"""Whether enough blocks of rows agree that a hypothesis gains: a sign test, which needs no noise model."""

from __future__ import annotations

import numpy as np
import scipy.special

from ident.diagnosis.rows.rows import Rows

BLOCK_S = 2.0  # s, longer than the noise remembers; shorter where there would be too few to agree
FEWEST, MANY = 12, 20
TRUST = 0.95  # no block counts as surer than this
FINE = 5000  # steps of the weights of all blocks


def agree(gains: np.ndarray, expected: np.ndarray, alpha: float) -> bool:
    """Whether more blocks gain (blocks,) than coins would at the rate alpha; expected: as of Evidence. Of so
    few that coins always would, none tells. (Of four clean robots of 300 a second of a turning joint was a
    load, in two blocks or none.)"""
    told = gains != 0
    weight = weights(expected[told])
    asked = rarely(len(weight), alpha) < 1
    return bool(asked and weight @ (gains[told] > 0) >= enough(weight, alpha))


def weights(expected: np.ndarray) -> np.ndarray:
    """(blocks,) log odds that a block's gain is positive, of expected gains (nats; it is normal about these
    with twice the variance), in whole steps of which all blocks have about FINE."""
    sure = np.clip(scipy.special.ndtr(np.sqrt(np.maximum(expected, 0.0) / 2)), 0.5, TRUST)
    odds = np.log(sure / (1 - sure))
    return np.round(odds * (FINE / max(float(odds.sum()), 1e-300))).astype(int)


def enough(weight: np.ndarray, alpha: float) -> int:
    """The least weight that must agree, of blocks with so much each: coins seldom add up to it."""
    rare = rarely(len(weight), alpha)
    likely, top = np.zeros(int(weight.sum()) + 1), 1
    likely[0] = 1.0
    for step in weight.tolist():
        half = likely[:top] / 2
        likely[:top] = half
        likely[step : step + top] += half
        top += step
    tail = np.cumsum(likely[::-1])[::-1]
    return int(np.argmax(tail <= rare)) if tail[-1] <= rare else len(tail)


def rarely(blocks: int, alpha: float) -> float:
    """How often coins may agree as well as so many blocks: at the rate alpha; of fewer than MANY less can be
    asked (ten of twelve have 2 %), and they only guard the likelihood, which has passed alpha itself."""
    return alpha * max(1.0, (MANY / max(blocks, 1)) ** 2)


def block_numbers(rows: Rows, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(masked rows,) number of each one's block, and (blocks,) which are not half empty."""
    seconds = min(BLOCK_S, max(mask.sum() * rows.hop / FEWEST, 4 * rows.hop))
    number = rows.piece[mask] * 1_000_000 + np.floor(rows.t[mask] / seconds).astype(int)
    _, block = np.unique(number, return_inverse=True)
    return block, np.bincount(block) > 0.5 * seconds / rows.hop


def block_sums(rows: Rows, values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Sums of values (M,) over blocks of the masked rows; half-empty blocks are left out."""
    block, kept = block_numbers(rows, mask)
    return np.bincount(block, values[mask], minlength=len(kept))[kept]
