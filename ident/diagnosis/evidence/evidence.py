"""What one model says for itself against another: a likelihood ratio on rows that chose nothing.

Everything about a hypothesis (place, window, shape, size, noise) is chosen on the fitted rows. On the
judged rows both models are whitened by the same noise and projected off the rigid model's own columns,
whose parameters stay free there (residual contrasts: Perez-Ortiz et al., Ann. Statist. 52(4), 2024), and

    log E = sum over channels  ln likelihood of the hypothesis as fitted - ln likelihood of the null

is the logarithm of a split likelihood ratio (Wasserman, Ramdas, Balakrishnan, PNAS 117(29), 2020):
whatever the search on the fitted rows was, P(log E > ln 1/alpha) <= alpha if the noise is what it is taken
for: the whitener's, and any slow noise, each model's own (slow_noise.py). Where parts of a run judge
others of it, that noise is one: the likelihood of the judged rows is that given the fitted ones. That
noise is such, is not taken for granted: blocks (blocks.py) each give their own gain, and enough of them
must be positive: a sign test, which needs no noise model. A block counts by how surely it would be
positive were the effect there as the fitted rows have it (the log of the odds, at most TRUST), which the
judged torque has no part in: where an effect hardly acts the sign is a coin's. (By signed ranks, which let
large gains count for more, two laws of one friction were told where one was wrong.)"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.special

from ident.diagnosis.evidence.blocks import agree, block_sums
from ident.diagnosis.evidence.metric import (
    Columns,
    Metric,
    Side,
    beside_model,
    changed,
    given_part,
    project,
)


@dataclass(frozen=True, slots=True)
class Evidence:
    """log_e on judged rows, gain (nats) on fitted ones, the blocks' own gains and what these are expected to
    be, the sizes as fitted."""

    log_e: float
    gain: float
    blocks: np.ndarray  # (blocks,)
    expected: np.ndarray  # (blocks,) nats, were the effect as fitted; inf: all blocks alike
    sizes: np.ndarray  # (p,)
    per_channel: np.ndarray  # (C,) of log_e
    rss: np.ndarray  # (C,) whitened, judged rows
    left: float  # smallest share of a column that the model leaves, 1: orthogonal to it
    free: np.ndarray  # (C,) judged rows less the parameters that they determine
    given: bool = False  # what is told of the judged rows is told given the fitted ones (given.py)

    def supported(self, alpha: float) -> bool:
        """Enough blocks agree."""
        return agree(self.blocks, self.expected, alpha)

    def contradicted(self, alpha: float) -> bool:
        """Some block gains less than chance allows, were the effect there as the fitted rows have it:
        normal about what is expected, with twice its variance."""
        told = self.blocks != 0
        short = (self.expected[told] - self.blocks[told]) / np.sqrt(
            2 * np.maximum(self.expected[told], 1e-300)
        )
        return bool(np.any(short > -scipy.special.ndtri(alpha / max(len(short), 1))))

    def beats(self, other: Evidence, tau: float, alpha: float) -> bool:
        """These data tell the two apart: the same comparison as against nothing, with the other as the null.
        Both of one metric."""
        if self.log_e - other.log_e <= tau:
            return False
        if self.blocks.shape != other.blocks.shape:
            return True  # a window's blocks are its own
        apart = self.blocks - other.blocks
        return replace(self, blocks=apart, expected=np.full(len(apart), np.inf)).supported(alpha)


def drop_percent(nats: float, free: float) -> float:
    """By how much the whitened error of a channel with `free` judged rows falls where log E is so many."""
    return float(100 * (1 - np.exp(-nats / max(free, 1.0))))


def weigh(
    m: Metric, columns: Columns, sizes: np.ndarray | None = None, inside: np.ndarray | None = None
) -> Evidence:
    """Fit the sizes of columns on the fitted rows (or take those given), judge them on the others; blocks
    are those of the rows `inside` (M,), where the columns act in some alone."""
    white = m.whiten(columns)
    cross, own, right = project(m, m.fitted, white)
    scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
    left = (own - cross.T @ cross) / np.outer(scale, scale)
    share = float(np.min(np.diag(left)))
    if sizes is None:
        sizes = np.linalg.lstsq(left + 1e-12 * np.eye(len(left)), right / scale, rcond=1e-9)[0] / scale
    fitted = changed(m, m.fitted, white, sizes, cross)
    residual = changed(m, m.judged, white, sizes, project(m, m.judged, white)[0])
    rss = np.einsum("cm,cm->c", residual, residual)
    if m.parted:
        both = changed(m, m.both, white, sizes, project(m, m.both, white)[0])
        per_channel = given_part(m.both, m.fitted, both, fitted) - m.told_given
    else:
        per_channel = m.judged.likelihood(residual) - m.judged.told
    gain = float(np.sum(m.fitted.likelihood(fitted) - m.fitted.told))
    spread = np.maximum(rss / m.judged.free, 1e-300)[:, None]
    each = np.sum((m.judged.residual**2 - residual**2) / (2 * spread), axis=0)
    change = np.sum((m.judged.residual - residual) ** 2 / (2 * spread), axis=0)
    here = m.judged.mask if inside is None else m.judged.mask & inside
    return Evidence(
        float(per_channel.sum()),
        gain,
        block_sums(m.rows, each, here),
        block_sums(m.rows, change, here),
        sizes,
        per_channel,
        rss,
        share,
        m.judged.free,
    )


def said(m: Metric, columns: Columns, sizes: np.ndarray) -> float:
    """Nats of columns of these sizes on the fitted rows."""
    white = m.whiten(columns)
    left = changed(m, m.fitted, white, sizes, project(m, m.fitted, white)[0])
    return float(np.sum(m.fitted.likelihood(left) - m.fitted.told))


def unseen(m: Metric, columns: Columns, sizes: np.ndarray, tau: float) -> bool:
    """Whether these columns at these sizes, were they true, would not reach the limit on the judged rows."""
    left, _ = beside_model(m, m.judged, m.whiten(columns))
    return 0.5 * float(sizes @ left @ sizes) < tau


def over(null: Metric, m: Metric, told: Evidence) -> Evidence:
    """What a hypothesis says beside the model of `m`, held against the model of `null`: both of one noise and
    of the same rows. Told given the fitted rows, so is what the one model is ahead of the other."""

    def nats(a: Side, b: Side) -> np.ndarray:
        if told.given and not m.parted:  # as in given.py
            return 0.5 * a.free * np.log(np.maximum(a.rss, 1e-300) / np.maximum(b.rss, 1e-300))
        return b.told * a.free / b.free - a.told

    fitted, ahead = nats(null.fitted, m.fitted), nats(null.judged, m.judged)
    one, other = null.judged, m.judged
    if told.given or m.parted:
        one, other = null.both, m.both
        ahead = m.told_given - null.told_given if m.parted else nats(one, other) - fitted
    spread = np.maximum(told.rss / m.judged.free, 1e-300)[:, None]
    each = np.sum((one.residual**2 - other.residual**2) / (2 * spread), axis=0)
    change = np.sum((one.residual - other.residual) ** 2 / (2 * spread), axis=0)
    return replace(
        told,
        log_e=told.log_e + float(ahead.sum()),
        gain=told.gain + float(fitted.sum()),
        blocks=told.blocks + block_sums(m.rows, each, m.judged.mask),
        expected=told.expected + block_sums(m.rows, change, m.judged.mask),
        per_channel=told.per_channel + ahead,
    )
