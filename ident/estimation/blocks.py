"""How far an estimate moves from stretch to stretch of the recordings, against what a noise model foretells.

An autoregressive noise model (noise.py) takes every channel's noise for the same at all times and for nobody
else's: what an encoder or a slightly wrong friction adds comes with the motion and in several channels at
once. Stretches longer than the noise remembers need no such model: with H_g = W_g Sigma W_g' Omega^-1, the
part of stretch g that is fitted by itself,

    cov(chi) = sum_g x_g x_g',   x_g = Sigma W_g' Omega^-1 (I - H_g)^(-1/2) rho_g

is the cluster-robust covariance whose stretches are corrected for the parameters that were fitted (Bell and
McCaffrey, Survey Methodology 28, 2002). It is known from few stretches: 1 / sum_g h_g^2 of them, h_g the
share of stretch g in what is known of a parameter, and Student's t of so many is its interval.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ident.equations.observation import RecordingSystem
from ident.estimation.least_squares import Estimate
from ident.estimation.noise import half_of

BLOCK_S, MOST = 2.0, 60  # s, longer than noise remembers; longer still where there would be more blocks
LEVEL = 0.95
ALONE = 0.99  # share of a direction from which on a stretch determines it alone


def widened(systems: Sequence[RecordingSystem], estimate: Estimate, covariance: np.ndarray) -> np.ndarray:
    """(b,) factors, one at least, by which the standard deviations of `covariance` (b, b) grow so that a
    normal interval of them holds: the larger of what the noise model and what the stretches say, each with
    Student's t of as many stretches as it is known from."""
    own = np.where(estimate.active, np.diag(covariance), 0.0)
    return by_stretches(half_of(estimate), _stretches(systems, estimate), own)


def by_stretches(
    half: np.ndarray, stretches: Iterable[tuple[np.ndarray, np.ndarray]], own: np.ndarray
) -> np.ndarray:
    """(b,) of them for an estimate whose covariance half half' (b, b) is where noise is white, of stretches'
    scores W'Omega^-1 rho (b,) and Gram matrices (b, b); own (b,): the variances that grow, 0 of what is not
    estimated."""
    moved, shares, blocks = np.zeros(len(half)), np.zeros(len(half)), 0
    known = np.maximum(np.sum(half**2, axis=1), 1e-300)
    for score, gram in stretches:
        B = half.T @ gram @ half
        values, V = np.linalg.eigh(B)
        free = np.sqrt(1 - np.clip(values, 0.0, ALONE))
        moved += (half @ (V @ ((V.T @ (half.T @ score)) / free))) ** 2
        shares += (np.einsum("ik,kl,il->i", half, B, half) / known) ** 2
        blocks += 1
    seen = (own > 0) & np.isfinite(own) & (shares > 0)
    if blocks < 2:
        return np.ones(len(half))
    ratio = np.sqrt(np.where(seen, moved, 1.0) / np.where(seen, own, 1.0))
    by_blocks = ratio * _longer(1 / np.where(seen, shares, 1.0))
    return np.where(seen, np.maximum(by_blocks, _longer(np.array(blocks - 1.0))), 1.0)


def stretch_s(total: float) -> float:
    """s of a stretch of so many seconds of recordings."""
    return max(BLOCK_S, total / MOST)


def _longer(free: np.ndarray) -> np.ndarray:
    """Student's half width over the normal one."""
    import scipy.special  # where effects are fitted: it takes a twelfth of a fit without

    q = 0.5 + LEVEL / 2
    return np.asarray(scipy.special.stdtrit(np.maximum(free, 1.0), q) / scipy.special.ndtri(q))


def _stretches(
    systems: Sequence[RecordingSystem], estimate: Estimate
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """(b,) W'Omega^-1 rho and (b, b) W'Omega^-1 W of every stretch."""
    spans = [float(s.t[-1] - s.t[0]) for system in systems for s in system.segments if len(s.t) > 1]
    seconds, b = stretch_s(sum(spans)), len(estimate.chi)
    for system in systems:
        for segment in system.segments:
            for _, piece in segment.pieces():
                number = np.floor((piece.t - piece.t[0]) / seconds).astype(int)
                edges = np.flatnonzero(np.diff(number, prepend=-1, append=number[-1] + 1))
                parts = [slice(a, z) for a, z in itertools.pairwise(edges)]
                score, gram = np.zeros((len(parts), b)), np.zeros((len(parts), b, b))
                for j, sigma in enumerate(estimate.sigma):
                    columns = np.unique(system.column[system.channel == j])
                    W = system.dense(piece, j, b)
                    rho = (piece.Y[j] - W @ estimate.chi) * piece.used[j] / sigma**2
                    W = W[:, columns]
                    for k, part in enumerate(parts):
                        score[k, columns] += W[part].T @ rho[part]
                        gram[k][np.ix_(columns, columns)] += W[part].T @ W[part] / sigma**2
                yield from zip(score, gram)
