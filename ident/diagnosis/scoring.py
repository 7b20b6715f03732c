"""Score of a candidate: log-likelihood gained over all joints, on the rows fitted and on rows never fitted.

The model is partialled out of every candidate (Frisch-Waugh-Lovell) in a basis where its weighted columns
are orthonormal. Every channel keeps its own Gram matrix per set of rows, so that weights, fits on part of
the rows and errors on the other part are small dense algebra:

    gain = sum over channels of (N_c f_c / 2) log(rss_before / rss_after)

N_c f_c counts effective samples: f_c = 1/(1 + 2 sum rho_k) from the residual that is left (Newey and West
1987).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

Columns = dict[int, np.ndarray]  # channel -> (M, p), the same p everywhere

LAGS = 25
RANK_TOLERANCE = 1e-9  # of the scaled Gram matrix: collinear to 3e-5


@dataclass(frozen=True, slots=True)
class Folds:
    """Which rows are fitted and which are only predicted. `sets[m]` is the number of row m's set, -1
    unused."""

    sets: np.ndarray  # (M,)
    identify: tuple[int, ...]  # sets that the final fit uses
    held_out: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]  # (fitted sets, predicted sets)
    by_validation: bool  # the predicted rows are recordings of their own
    by_recording: bool = False  # identify recordings predict each other

    @property
    def count(self) -> int:
        return int(self.sets.max()) + 1


def make_folds(
    run: np.ndarray,
    t: np.ndarray,
    roles: Sequence[str],
    payloads: Sequence[str | None] = (),
    block_seconds: float = 3.0,
) -> Folds:
    """Validate recordings are predicted from the identify ones. Without any, each identify recording from
    the others (blocks of a periodic motion repeat each other); with one alone, or where only some carry a
    payload, alternating blocks in four sets."""
    role = np.array(roles)[run]
    sets = np.full(len(run), -1)
    if (role == "validate").any():
        sets[role == "identify"] = 0
        sets[role == "validate"] = 1
        return Folds(sets, (0,), (((0,), (1,)),), True)
    rows = role == "identify"
    runs = np.unique(run[rows])
    if len(runs) > 1 and len({payloads[r] for r in runs} if payloads else {None}) == 1:
        sets[rows] = np.searchsorted(runs, run[rows])
        every = tuple(range(len(runs)))
        held = tuple((tuple(s for s in every if s != k), (k,)) for k in every)
        return Folds(sets, every, held, False, True)
    span = sum(np.ptp(t[rows & (run == r)]) for r in np.unique(run[rows]))
    block = min(block_seconds, max(0.5, span / 16.0))
    order = np.zeros(len(run), dtype=int)
    offset = 0
    for r in np.unique(run[rows]):
        inside = rows & (run == r)
        number = np.floor((t[inside] - t[inside].min()) / block).astype(int)
        order[inside] = number + offset
        offset += int(number.max()) + 1
    sets[rows] = order[rows] % 4
    every = (0, 1, 2, 3)
    held = tuple((tuple(s for s in every if s != k), (k,)) for k in every)
    return Folds(sets, every, held, False)


@dataclass(frozen=True, slots=True)
class Score:
    """What a set of extra columns gains. Gains are log-likelihoods, >= 0 on identify."""

    identify: float
    held_out: float
    coefficients: np.ndarray  # (p,) fitted on the identify rows
    rss: np.ndarray  # (channels,) on the identify rows
    rss_held: np.ndarray  # (channels,) on the held-out rows
    collinear: float  # smallest share of a column that the model leaves, 1 = orthogonal

    @property
    def total(self) -> float:
        return self.identify + self.held_out


@dataclass(frozen=True)
class Bank:
    """Model columns at the kept instants with their Gram matrices per set and channel: made once for given
    folds."""

    base: np.ndarray  # (channels, M, k)
    keep: np.ndarray  # (channels, M)
    folds: Folds
    masks: np.ndarray  # (sets, channels, M) 1.0 where the row is in the set and kept
    gram: np.ndarray  # (sets, channels, k, k)
    count: np.ndarray  # (sets, channels)


def make_bank(base: np.ndarray, keep: np.ndarray, folds: Folds) -> Bank:
    S, (C, M, k) = folds.count, base.shape
    masks = np.zeros((S, C, M))
    gram = np.zeros((S, C, k, k))
    for s in range(S):
        masks[s] = (folds.sets == s)[None, :] & keep
        for c in range(C):
            block = base[c, masks[s, c] > 0]
            gram[s, c] = block.T @ block
    return Bank(base, keep, folds, masks, gram, masks.sum(axis=2))


@dataclass(frozen=True)
class System:
    """Model and found columns with their Gram matrices in a basis orthonormal at the final weights."""

    bank: Bank
    extra: np.ndarray  # (channels, M, e) columns of what was found
    y: np.ndarray  # (channels, M)
    basis: np.ndarray  # (columns, b)
    gram: np.ndarray  # (sets, channels, b, b)
    xy: np.ndarray  # (sets, channels, b)
    yy: np.ndarray  # (sets, channels)
    count: np.ndarray  # (sets, channels)
    weight: np.ndarray  # (channels,) 1/sigma^2 of the fit without a candidate
    beta: np.ndarray  # (b,)
    rss: np.ndarray  # (channels,) identify
    rss_held: np.ndarray  # (channels,)
    residual: np.ndarray  # (channels, M) of all rows, frozen at the identify fit
    share: np.ndarray  # (channels,) effective samples per row

    @property
    def folds(self) -> Folds:
        return self.bank.folds

    @property
    def keep(self) -> np.ndarray:
        return self.bank.keep

    @property
    def coefficients(self) -> np.ndarray:
        """Of the columns that the system was made of."""
        return self.basis @ self.beta

    def rows_of(self, sets: Sequence[int]) -> np.ndarray:
        return np.isin(self.folds.sets, sets)

    def project(self, c: int, z: np.ndarray) -> np.ndarray:
        """(b, p): basis columns of channel c times z (M, p)."""
        raw = np.concatenate([self.bank.base[c].T @ z, self.extra[c].T @ z])
        return self.basis.T @ raw

    def identify_mask(self, c: int) -> np.ndarray:
        """(M,) 1.0 on the rows of channel c that are fitted."""
        return self.bank.masks[list(self.folds.identify), c].sum(axis=0)

    def cross(self, columns: Columns) -> dict:
        """Products of candidate columns with model and torque, per set and channel."""
        p = next(iter(columns.values())).shape[1]
        S, C, b = len(self.gram), len(self.y), self.basis.shape[1]
        A = np.zeros((S, C, b, p))
        Z = np.zeros((S, C, p, p))
        v = np.zeros((S, C, p))
        for c, z in columns.items():
            masked = [z * self.bank.masks[s, c][:, None] for s in range(S)]
            A[:, c] = self.project(c, np.hstack(masked)).reshape(b, S, p).transpose(1, 0, 2)
            for s in range(S):
                Z[s, c] = masked[s].T @ z
                v[s, c] = masked[s].T @ self.y[c]
        return {"A": A, "Z": Z, "v": v}

    def score(self, columns: Columns, share: np.ndarray | None = None) -> Score:
        """Gain of adding `columns`, on identify rows and on held-out rows with everything frozen."""
        p = next(iter(columns.values())).shape[1]
        total = np.zeros(p)
        for c, z in columns.items():
            total += self.weight[c] * (self.identify_mask(c) @ (z * z))
        scale = np.sqrt(total)
        scale[~(scale > 0)] = 1.0
        x = self.cross({c: z / scale for c, z in columns.items()})
        share = self.share if share is None else share
        solution, rss, left = self._fit(self.folds.identify, x, p)
        held = np.zeros(len(self.y))
        for train, test in self.folds.held_out:
            part = solution if train == self.folds.identify else self._fit(train, x, p)[0]
            held += self._rss(test, part, x)
        N = self.count[list(self.folds.identify)].sum(axis=0)
        tests = [s for _, test in self.folds.held_out for s in test]
        N_held = self.count[tests].sum(axis=0)
        gain = float(np.sum(share * N / 2 * _log_ratio(self.rss, rss)))
        gain_held = float(np.sum(share * N_held / 2 * _log_ratio(self.rss_held, held)))
        return Score(gain, gain_held, solution[-p:] / scale, rss, held, left)

    def _fit(self, sets: Sequence[int], x: dict | None, p: int) -> tuple[np.ndarray, np.ndarray, float]:
        return fit_sets(self.gram, self.xy, self.yy, self.count, self.weight, list(sets), x, p)

    def _rss(self, sets: Sequence[int], solution: np.ndarray, x: dict | None) -> np.ndarray:
        return _rss(self.gram, self.xy, self.yy, list(sets), solution, x)


def _log_ratio(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    tiny = 1e-30
    return np.log(np.maximum(before, tiny) / np.maximum(after, tiny))


def fit_sets(gram, xy, yy, count, weight, sets, x, p, iterations: int = 4):
    """Weighted least squares with one noise level per channel, iterated to maximum likelihood."""
    b = gram.shape[-1]
    G, g, e, N = gram[sets].sum(0), xy[sets].sum(0), yy[sets].sum(0), count[sets].sum(0)
    if p:
        A, Z, v = x["A"][sets].sum(0), x["Z"][sets].sum(0), x["v"][sets].sum(0)
    omega = weight
    solution = np.zeros(b + p)
    left = 1.0
    rss = e.copy()
    for turn in range(iterations):
        H = np.empty((b + p, b + p))
        h = np.empty(b + p)
        H[:b, :b] = np.tensordot(omega, G, 1)
        h[:b] = omega @ g
        if p:
            H[:b, b:] = np.tensordot(omega, A, 1)
            H[b:, :b] = H[:b, b:].T
            H[b:, b:] = np.tensordot(omega, Z, 1)
            h[b:] = omega @ v
        H[np.diag_indices(b + p)] += 1e-9 * max(1.0, float(np.trace(H)) / (b + p))
        factor = scipy.linalg.cho_factor(H, lower=True, check_finite=False)
        if p and turn == 0:
            left = float(np.min(np.diag(factor[0])[b:] ** 2 / np.maximum(np.diag(H)[b:], 1e-300)))
        solution = scipy.linalg.cho_solve(factor, h, check_finite=False)
        rss = _rss(gram, xy, yy, sets, solution, x if p else None)
        omega = N / np.maximum(rss, 1e-30)
    return solution, rss, left


def _rss(gram, xy, yy, sets, solution, x) -> np.ndarray:
    b = gram.shape[-1]
    beta = solution[:b]
    G, g, e = gram[sets].sum(0), xy[sets].sum(0), yy[sets].sum(0)
    rss = e - 2 * g @ beta + (G @ beta) @ beta
    if x is not None:
        a = solution[b:]
        A, Z, v = x["A"][sets].sum(0), x["Z"][sets].sum(0), x["v"][sets].sum(0)
        rss = rss - 2 * v @ a + 2 * (np.swapaxes(A, 1, 2) @ beta) @ a + (Z @ a) @ a
    return np.maximum(rss, 1e-12 * np.maximum(e, 1e-30))


def make_system(bank: Bank, extra: np.ndarray, y: np.ndarray) -> System:
    """System of the bank's model columns followed by `extra` (channels, M, e): what was found,
    sensitivities."""
    S, C, _M = bank.masks.shape
    k, e = bank.base.shape[2], extra.shape[2]
    gram, xy, yy = np.zeros((S, C, k + e, k + e)), np.zeros((S, C, k + e)), np.zeros((S, C))
    gram[:, :, :k, :k] = bank.gram
    for c in range(C):
        masks = bank.masks[:, c]
        torque = masks * y[c]  # (S, M)
        xy[:, c, :k] = torque @ bank.base[c]
        yy[:, c] = torque @ y[c]
        if e and np.any(extra[c]):
            xy[:, c, k:] = torque @ extra[c]
            masked = np.concatenate([extra[c] * m[:, None] for m in masks], axis=1)  # (M, S e)
            gram[:, c, :k, k:] = (bank.base[c].T @ masked).reshape(k, S, e).transpose(1, 0, 2)
            gram[:, c, k:, :k] = np.swapaxes(gram[:, c, :k, k:], 1, 2)
            gram[:, c, k:, k:] = (extra[c].T @ masked).reshape(e, S, e).transpose(1, 0, 2)
    sets = list(bank.folds.identify)
    count = bank.count
    sigma2 = yy[sets].sum(0) / np.maximum(count[sets].sum(0), 1) + 1e-12
    basis = _orthonormal(np.tensordot(1.0 / sigma2, gram[sets].sum(0), 1))
    gram, xy = basis.T @ gram @ basis, xy @ basis
    solution, rss, _ = fit_sets(gram, xy, yy, count, 1.0 / sigma2, sets, None, 0, iterations=8)
    weight = count[sets].sum(0) / np.maximum(rss, 1e-30)
    turn = _orthonormal(np.tensordot(weight, gram[sets].sum(0), 1))  # orthonormal at the final weights
    basis = basis @ turn
    gram, xy = turn.T @ gram @ turn, xy @ turn
    solution, rss, _ = fit_sets(gram, xy, yy, count, weight, sets, None, 0, iterations=1)
    held = np.zeros(C)
    for train, test in bank.folds.held_out:
        part = solution
        if train != bank.folds.identify:
            part = fit_sets(gram, xy, yy, count, weight, list(train), None, 0)[0]
        held += _rss(gram, xy, yy, list(test), part, None)
    raw = basis @ solution
    residual = y - bank.base @ raw[:k] - (extra @ raw[k:] if e else 0.0)
    share = np.array([effective_share(residual[c], bank.folds, bank.keep[c]) for c in range(C)])
    return System(bank, extra, y, basis, gram, xy, yy, count, weight, solution, rss, held, residual, share)


def _orthonormal(H: np.ndarray) -> np.ndarray:
    """(k, b) with columns' weighted Gram matrix H turned to the identity; directions without data are left
    out."""
    d = np.sqrt(np.maximum(np.diag(H), 1e-300))
    values, vectors = np.linalg.eigh(H / np.outer(d, d))
    good = values > RANK_TOLERANCE * values[-1]
    return vectors[:, good] / np.sqrt(values[good]) / d[:, None]


def effective_share(residual: np.ndarray, folds: Folds, keep: np.ndarray, lags: int = LAGS) -> float:
    """Effective samples per row from the residual's autocorrelation (Bartlett weights), within [0.02, 1]."""
    rows = np.isin(folds.sets, folds.identify) & keep
    r = np.where(rows, residual, 0.0)
    power = float(r @ r)
    if power <= 0:
        return 1.0
    total = 1.0
    for k in range(1, lags + 1):
        total += 2 * (1 - k / (lags + 1)) * float(r[k:] @ r[:-k]) / power
    return float(np.clip(1.0 / max(total, 1e-3), 0.02, 1.0))
