"""What dry friction's turn-over takes up of an effect that the model lacks.

The widths of the turn-over are fitted before anything is looked for (turn_over.py). A torque a Z v that is
missing moves them from s(w0) to the s(w) that imitates it best, and what is left to be seen is

    a Z v + Fc (s(w0) - s(w))   off the model with s(w) in place of s(w0)

W holds the columns Z and the joint's sign for a ladder of widths, first the width at hand, all off the model
without that sign. All products that decide are in the Gram matrices of W: of the fitted rows, and block by
block of the judged ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.evidence.blocks import block_numbers
from ident.diagnosis.evidence.metric import Metric, Side, project
from ident.diagnosis.evidence.state import State
from ident.diagnosis.rows.signs import sign_columns
from ident.diagnosis.rows.turn_over import grids, with_column

EVERY = 2  # of the ladder's widths
LEAST = 1e-9  # of a sign's square that the model must leave for it to take up anything


@dataclass(frozen=True)
class Dryness:
    """A metric without one joint's sign, the signs {channel: (M, K)} whitened, and that joint's Fc [N m]."""

    metric: Metric
    signs: Mapping[int, np.ndarray]
    friction: float


@dataclass(frozen=True)
class Left:
    """What is left of an effect, and of its p columns: on the fitted rows the columns' products A (p, p), own
    (p,) with the effect, and its square; on the judged rows the same, for each of their k blocks."""

    A: np.ndarray
    own: np.ndarray
    square: float
    A_blocks: np.ndarray
    own_blocks: np.ndarray
    square_blocks: np.ndarray


def dryness(state: State, joint: int) -> Dryness | None:
    """None where the joint's sign has no width to settle."""
    found = [d for d in state.problem.dry if d.joint == joint and joint in state.turns]
    if len(found) != 1 or len({place for _, place in found[0].places}) != 1:
        return None
    channels = [channel for channel, _ in found[0].places]
    none = {channel: np.zeros(len(state.rows.t)) for channel in channels}
    friction = abs(float(state.beta[found[0].places[0][1]]))
    turn = state.turns[joint]
    widths = [float(w) for w in grids(state.segments, joint)["rate"][::EVERY]]
    turns = [turn, *(replace(turn, rate=w) for w in widths)]
    signs = {
        c: state.whiteners[c] @ sign_columns(state.segments, state.rows, joint, c, turns) for c in channels
    }
    without = replace(state, rows=with_column(state.rows, found[0], none))
    return Dryness(without.metric, signs, friction)


@dataclass(frozen=True)
class Products:
    """Gram matrices of W, the first p columns an effect's: fitted (w, w), judged blocks (k, w, w). signs: the
    columns behind them that the model does not imitate wholly, on either rows."""

    p: int
    friction: float
    fitted: np.ndarray
    blocks: np.ndarray
    signs: np.ndarray

    def left(self, v: np.ndarray, size: float) -> Left:
        """Of size * Z v beside the width that imitates it best. v (p,)."""
        F, B, p = self.fitted, self.blocks, self.p
        mean = np.zeros(len(F))
        mean[:p] = size * v
        if len(self.signs):
            mean[p] = self.friction
            k = self.signs[np.argmax((F[self.signs] @ mean) ** 2 / np.diag(F)[self.signs])]
            F = F - np.outer(F[k], F[k]) / F[k, k]
            total = B.sum(axis=0)
            take = total[k] / total[k, k]
            B = (
                B - take[None, :, None] * B[:, None, k, :] - B[:, :, k, None] * take[None, None, :]
                + B[:, k, k, None, None] * np.outer(take, take)
            )  # fmt: skip
        return Left(
            F[:p, :p], F[:p] @ mean, float(mean @ F @ mean),
            B[:, :p, :p], B[:, :p] @ mean, np.einsum("i,kij,j->k", mean, B, mean),
        )  # fmt: skip


def products(
    m: Metric, white: Mapping[int, np.ndarray], dry: Dryness | None = None, both: Side | None = None
) -> Products:
    """Of whitened columns {channel: (M, p)} beside the model of `m`, and beside its turn-over where one is
    given. `both`, all rows of that metric: of the judged rows given the fitted ones, whose products with
    those parameters come behind the blocks'."""
    p = next(iter(white.values())).shape[1]
    W, friction = dict(white), 0.0
    if dry is not None:
        m, friction = dry.metric, dry.friction
        K, M = next(iter(dry.signs.values())).shape[1], len(m.rows.t)
        W = {
            c: np.hstack((white.get(c, np.zeros((M, p))), dry.signs.get(c, np.zeros((M, K)))))
            for c in {*white, *dry.signs}
        }
    cross, own, _ = project(m, m.fitted, W)
    fitted = own - cross.T @ cross
    blocks = judged_blocks(m, W, both or m.judged)
    if both is not None:
        of_all, all_own, _ = project(m, both, W)
        blocks = np.concatenate((blocks, (all_own - of_all.T @ of_all - blocks.sum(axis=0))[None]))
    left = np.minimum(np.diag(fitted), np.diag(blocks.sum(axis=0)))[p:]
    return Products(p, friction, fitted, blocks, p + np.flatnonzero(left > LEAST * np.diag(own)[p:]))


def judged_blocks(m: Metric, white: Mapping[int, np.ndarray], side: Side) -> np.ndarray:
    """(blocks, w, w) products of the columns beside the model as the rows of a side have it, block by block
    of the judged rows."""
    cross, _, _ = project(m, side, white)
    beta = side.basis @ cross
    number, kept = block_numbers(m.rows, m.judged.mask)
    out = np.zeros((len(kept), cross.shape[1], cross.shape[1]))
    order = np.argsort(number, kind="stable")
    ends = np.cumsum(np.bincount(number, minlength=len(kept)))
    for c, (places, values) in enumerate(m.X):
        on = m.judged.mask
        left = -values[on] @ beta[places]
        if c in white:
            left = left + white[c][on]
        left = np.where(m.rows.use[c][on][:, None], left, 0.0)[order]
        for k, end in enumerate(ends):
            part = left[(ends[k - 1] if k else 0) : end]
            out[k] += part.T @ part
    return out[kept]
