"""What the judged rows show only together with the fitted ones: by the parameters that both have in common.

On the judged rows alone the model's own parameters stay free, and a short run holds next to nothing that they
do not answer: of a spring that takes a Franka's error there from 16 to 3 % seven nats were left. Given the
fitted rows they are not free. With flat priors on the model's parameters the ratio of what two models say of
all rows is a martingale over rows that come one after the other (residual contrasts, as in evidence.py), so

    log E = log E(all rows) - log E(fitted rows),   everything about the hypothesis chosen on the fitted rows

is bounded as the judged rows' own is. It takes the parameters for the same in all recordings, which another
friction or load is not: so with the hypothesis they must be. That the judged runs have parameters of their
own is the explanation without a name here, and must not say more than tau beyond it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.evidence import Columns, Evidence, Metric, Side, block_sums, changed, project, side_of
from ident.diagnosis.halves import foretells, holds_by_halves, is_left_of_a_law
from ident.diagnosis.refine import Refined
from ident.diagnosis.state import State
from ident.diagnosis.sufficiency import sufficiency, sufficient
from ident.diagnosis.weighing import Weighed, best_held, holds, main_channel


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
            e, log_e=log_e, blocks=self.blocks, expected=self.expected, per_channel=self.per_channel
        )


def by_common(
    state: State, weighed: Weighed, tau: float, alpha: float
) -> tuple[Refined, Evidence, tuple[tuple[Refined, Evidence], ...]] | None:
    """Of the hypotheses that the judged rows show given the fitted ones the simplest of the best, and what
    else does; None where nothing does."""
    m, held = weighed.metric, []
    both = all_rows(m)
    for r, e in weighed.all:
        if not e.gain > tau or r.at_bound or is_left_of_a_law(state, r):
            continue
        given = given_fitted(m, both, r.columns, e.sizes)
        told = given.of(e)
        if given.differ > tau or told.contradicted(alpha) or not holds(state, m, r, told, tau, alpha):
            continue
        if not foretells(state, r, told):
            continue
        flex = sufficiency(state, m, r, main_channel(told, r.term, state), tau)
        if sufficient(r.term, told, flex, tau):
            held.append((r, told))
    return best_held(held, tau)


def shown_by_fitted(state: State, columns: Columns, sizes: np.ndarray, tau: float) -> bool:
    """Whether what the judged rows alone do not show is asked for by both halves of the fitted rows, or by
    the judged ones given these; state: without it."""
    return holds_by_halves(state, columns, sizes, tau) or holds_in_common(state, columns, sizes, tau)


def holds_in_common(state: State, columns: Columns, sizes: np.ndarray, tau: float) -> bool:
    """Whether the judged rows ask for what was found given the fitted ones; state: without it."""
    given = given_fitted(state.metric, all_rows(state.metric), columns, sizes)
    return bool(given.differ < tau and given.per_channel.sum() > tau)


def all_rows(m: Metric) -> Side:
    """The model on the fitted and the judged rows together."""
    return side_of(m.rows, m.X, m.y, m.B, m.fitted.mask | m.judged.mask)


def given_fitted(m: Metric, both: Side, columns: Columns, sizes: np.ndarray) -> Given:
    """The judged rows beside the fitted ones, of columns with the sizes (p,) that these have; both:
    `all_rows`."""
    white = m.whiten(columns)
    before, after = [], []
    for side in (both, m.fitted, m.judged):
        before.append(side.residual)
        after.append(changed(m, side, white, sizes, project(m, side, white)[0]))
    (plain, *_), (left, *_) = before, after
    rss = [np.maximum(np.einsum("cm,cm->c", r, r), 1e-300) for r in (*before, *after)]
    all_rows = both.free / 2 * np.log(rss[0] / rss[3])
    spread = np.maximum(rss[3] / both.free, 1e-300)[:, None]
    mask = m.judged.mask
    return Given(
        all_rows - m.fitted.free / 2 * np.log(rss[1] / rss[4]),
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
