"""What the judged rows say given the fitted ones: the ratio of two models on all rows over that on the fitted
ones, the model's parameters free in both (in_common.py)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.evidence.blocks import block_sums
from ident.diagnosis.evidence.evidence import Evidence
from ident.diagnosis.evidence.metric import Columns, Metric, Side, changed, given_part, project


@dataclass(frozen=True)
class Given:
    """What columns say of the judged rows given the fitted ones. per_channel (C,) of log E; blocks and
    expected (blocks,) as in Evidence; differ: nats by which, beside them, their channels still speak for
    parameters of the judged rows' own, each paid by half the logarithm of these rows."""

    per_channel: np.ndarray
    blocks: np.ndarray
    expected: np.ndarray
    differ: float

    def of(self, e: Evidence) -> Evidence:
        """In the place of what the judged rows say alone."""
        log_e = float(self.per_channel.sum())
        return replace(
            e,
            log_e=log_e,
            blocks=self.blocks,
            expected=self.expected,
            per_channel=self.per_channel,
            given=True,
        )


def given_fitted(m: Metric, both: Side, columns: Columns, sizes: np.ndarray) -> Given:
    """The judged rows beside the fitted ones, of columns with the sizes (p,) that these have; both:
    `Metric.both`. Of recordings of their own noise counts as the whitener has it: what slow noise there would
    say, parameters of their own say, too (`differ`)."""
    white = m.whiten(columns)
    before, after = [], []
    for side in (both, m.fitted, m.judged):
        before.append(side.residual)
        after.append(changed(m, side, white, sizes, project(m, side, white)[0]))
    (plain, *_), (left, *_) = before, after
    rss = [np.maximum(np.einsum("cm,cm->c", r, r), 1e-300) for r in (*before, *after)]
    of_all = both.free / 2 * np.log(rss[0] / rss[3])
    ahead = of_all - m.fitted.free / 2 * np.log(rss[1] / rss[4])
    if m.parted:
        ahead = given_part(both, m.fitted, left, after[1]) - m.told_given
    spread = np.maximum(rss[3] / both.free, 1e-300)[:, None]
    mask = m.judged.mask
    return Given(
        ahead,
        block_sums(m.rows, np.sum((plain**2 - left**2) / (2 * spread), axis=0), mask),
        block_sums(m.rows, np.sum((plain - left) ** 2 / (2 * spread), axis=0), mask),
        sum(_own_parameters(m, both.free, rss[3:], c) for c in columns),
    )


def _own_parameters(m: Metric, free: np.ndarray, rss: list[np.ndarray], c: int) -> float:
    """Nats by which a channel speaks for parameters of the judged rows' own, less their price; rss: of all
    rows, the fitted and the judged ones (Chow, Econometrica 28(3), 1960)."""
    both, fitted, judged = (float(its[c]) for its in rss)
    parameters = max(float(free[c] - m.fitted.free[c] - m.judged.free[c]), 0.0)
    rows = max(int((m.judged.mask & m.rows.use[c]).sum()), 2)
    nats = (both - fitted - judged) / (2 * max(judged / m.judged.free[c], 1e-300))
    return nats - 0.5 * parameters * float(np.log(rows))
