"""Whether each block of the fitted rows is foretold by all the others, better with a function without a name
than without it.

What a function says of the rows that chose it is told of a spike, too, and of noise that is loud for a while:
there a few rows say it all. Left out one after the other, each block is foretold by a model that has not seen
it: by the function's Gaussian process, the parameters, slow noise and what is not known of turns
(unknown_turns.py) as all other blocks have them. With P = K^-1 - K^-1 X (X' K^-1 X)^-1 X' K^-1 of all rows,
block k of n of them is normal about its forecast (S. Sundararajan and S. S. Keerthi, Neural Computation
13(5), 2001), as loud as it is itself:

    ln p(y_k | the others) = -n/2 ln (P y)_k' P_kk^-1 (P y)_k + 1/2 ln det P_kk   but for a constant

One noise for all of them is what a few loud rows make it: a function that met those made it smaller, and each
other block seemed foretold by it. (At one turn of 30 of a clean arm: 253 nats, and 20 in every other block;
where the noise was loud with the load three blocks of 26 said 127 of 163.)"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ident.diagnosis.evidence.blocks import block_numbers
from ident.diagnosis.evidence.metric import Metric, changed, project
from ident.diagnosis.evidence.nameless import Flexible
from ident.diagnosis.evidence.state import State
from ident.diagnosis.rows.unknown_turns import unknown_turns
from ident.signals.dry_friction import TurnOver

TINY = 1e-9  # of a block's precision: a direction that the others leave free
SIZES = np.concatenate([[0.0], np.geomspace(1e-2, 1e8, 61)])  # of the turns' variance, times the noise's


def block_gains(state: State, m: Metric, c: int, flex: Flexible) -> np.ndarray:
    """(blocks,) nats by which a channel's function foretells each block of the fitted rows."""
    side, noise, joint = m.fitted, m.fitted.noise[c], state.model.channels[c].joint
    on, (places, values) = noise.on, m.X[c]
    white = m.whiten({c: flex.column[:, None]})
    beside = changed(m, side, white, np.ones(1), project(m, side, white)[0])[c]
    turns = unknown_turns(state.segments, joint, state.turns.get(joint, TurnOver()))
    turns = (m.whiteners[c] @ (turns * m.rows.scale[c][:, None]))[on]
    room = (m.whiteners[c] @ flex.room)[on]
    numbers, kept = block_numbers(m.rows, on)
    X, y = values[on] @ side.basis[places], m.y[c, on]
    own = []
    for residual in (beside, side.residual[c]):
        slow, _ = noise.most_likely(residual)
        own.append((slow, *_of_turns(turns, slow, residual[on], noise.free)))
    power = own[0][-1]
    power *= noise.free / max(noise.free - _used(room / np.sqrt(power)), 1.0)
    told = []
    for (slow, size, its), rooms in zip(own, ([room], [])):
        parts = [slow * np.sqrt(its / power), np.sqrt(size * its / power) * turns]
        parts += [z / np.sqrt(power) for z in rooms]
        told.append(_foretold(X, parts, y / np.sqrt(power), numbers))
    return np.asarray(told[0] - told[1])[kept]


def _of_turns(turns: np.ndarray, slow: np.ndarray, e: np.ndarray, free: float) -> tuple[float, float]:
    """Variance of what is not known of turns (rows, K) that suits a residual (rows,) best, in units of the
    white noise's, beside slow noise (rows, k) of unit size; and the white noise's."""
    root = np.linalg.cholesky(np.eye(slow.shape[1]) + slow.T @ slow)
    across = np.linalg.solve(root, slow.T @ np.column_stack([turns, e]))
    G = turns.T @ turns - across[:, :-1].T @ across[:, :-1]
    h = turns.T @ e - across[:, :-1].T @ across[:, -1]
    whole = max(float(e @ e - across[:, -1] @ across[:, -1]), TINY * float(e @ e))
    s, V = np.linalg.eigh(G)
    spread = 1 + SIZES[:, None] * np.maximum(s, 0.0)
    rss = np.maximum(whole - np.sum((V.T @ h) ** 2 * SIZES[:, None] / spread, axis=1), TINY * whole)
    k = int(np.argmax(-0.5 * free * np.log(rss) - 0.5 * np.log(spread).sum(axis=1)))
    return float(SIZES[k]), float(rss[k]) / free


def _used(room: np.ndarray) -> float:
    """Numbers of the rows that functions (rows, k) of unit size take up."""
    s = np.linalg.svd(room, compute_uv=False) ** 2
    return float(np.sum(s / (1 + s)))


def _foretold(X: np.ndarray, parts: Sequence[np.ndarray], y: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """(blocks,) of white noise of unit variance, parts (rows, k) of unit size, and X (rows, r) of any."""
    S, r = np.hstack([X, *parts]), X.shape[1]
    G = S.T @ S
    G[np.arange(r, len(G)), np.arange(r, len(G))] += 1.0
    d = np.sqrt(np.maximum(np.diag(G), 1e-300))
    w, V = np.linalg.eigh(G / np.outer(d, d))
    good = w > 1e-10 * w[-1]
    U = S @ (V[:, good] / np.sqrt(w[good]) / d[:, None])
    left = y - U @ (U.T @ y)
    out = np.zeros(numbers.max() + 1)
    for k in range(len(out)):
        mine = numbers == k
        P = np.eye(mine.sum()) - U[mine] @ U[mine].T
        w, V = np.linalg.eigh(P)
        w = np.maximum(w, TINY)
        mean = max(float(np.mean((V.T @ left[mine]) ** 2 / w)), TINY)
        out[k] = 0.5 * np.log(w).sum() - 0.5 * len(w) * np.log(mean)
    return out
