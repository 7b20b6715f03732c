"""The noise of every channel, and rows whitened by it, so that a gain in log-likelihood means what it says.

Residuals of decimated torque are correlated: by the filter, by slow drives, by friction that no model has.
Per channel an autoregression of the residual is taken by Burg's method over the stretches between masked
rows (order by BIC, memory at most `MEMORY_S`: what lasts longer is in slow_noise.py). An
autocovariance of pairs has errors of its own at every lag where rows are masked, and asks for all orders.
Each used row minus its prediction from the nearest used rows before it in its piece (Vecchia's approximation,
exact for an autoregression without gaps; A. V. Vecchia, J. R. Statist. Soc. B 50, 1988), over the standard
deviation of that prediction, is a whitened row. Stretches of unusual power (a contact, a knock) do not enter
the noise model, or they would become noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.signal
import scipy.sparse
import scipy.stats

from ident.diagnosis.rows.rows import Rows

MEMORY_S = 1.0  # s: the longest correlation that counts as noise
BLOCK_S = 1.5  # s: stretches whose power is compared
RINGING = 4096  # rows after which an autoregression has forgotten a shock
SPANNED = 1e-10  # of the largest square: a direction that columns have no part in


@dataclass(frozen=True, slots=True)
class Whitener:
    """L (M, M) sparse: rows of one channel -> whitened rows of unit variance; 0 where a row is not used. Of
    torques that may have any size, `taken`, nothing is left."""

    L: scipy.sparse.csr_array
    sigma: float  # standard deviation of the innovation, N m
    coefficients: np.ndarray  # (p,)
    covariance: np.ndarray  # (k,) of the autoregression, at lags of 0, 1, ... rows
    taken: np.ndarray | None = None  # (M, r) orthonormal, whitened

    @classmethod
    def white(cls, use: np.ndarray, sigma: float = 1.0) -> Whitener:
        """As if the noise of the rows in `use` (M,) were white."""
        every = np.arange(len(use))
        L = scipy.sparse.csr_array((use / sigma, (every, every)), shape=(len(use), len(use)))
        return cls(L, sigma, np.zeros(0), np.array([sigma**2]))

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        white = np.asarray(self.L @ x)
        return white if self.taken is None else white - self.taken @ (self.taken.T @ white)

    def only(self, chosen: np.ndarray) -> Whitener:
        """Of some rows (k,), whole pieces."""
        taken = None if self.taken is None else self.taken[chosen]
        return replace(self, L=self.L[chosen][:, chosen], taken=taken)

    def beside(self, torques: np.ndarray, sides: Sequence[np.ndarray]) -> Whitener:
        """The same beside torques (M, K) of any size, each of its own on each side (M,) of the rows. (As
        columns of the model those of an AIRBOT in coarse steps, which turn a thousand times where joints
        stand, were four gigabytes and minutes.)"""
        parts = [_spanned(np.where(side[:, None], self @ torques, 0.0)) for side in sides]
        return replace(self, taken=np.hstack(parts))

    def seeing(self, use: np.ndarray, piece: np.ndarray) -> Whitener:
        """The same noise where other rows (M,) are used: none is foretold from those that are not."""
        return replace(self, L=_vecchia(use, piece, self.covariance, len(self.coefficients)))

    @property
    def news(self) -> float:
        """Rows of white noise that say as much of its variance as one row (M. S. Bartlett, J. R. Statist.
        Soc. Suppl. 8, 1946)."""
        one = np.zeros(RINGING)
        one[0] = 1.0
        h = scipy.signal.lfilter([1.0], [1.0, *-self.coefficients], one)
        spectrum = np.abs(np.fft.rfft(h, 2 * RINGING)) ** 2
        r = np.fft.irfft(spectrum)[:RINGING]
        return float(1 / (1 + 2 * np.sum((r[1:] / r[0]) ** 2)))


def _spanned(Z: np.ndarray) -> np.ndarray:
    """(M, r) orthonormal columns that span those of Z (M, K); by the products of its rows where these are
    fewer."""
    norm = np.sqrt(np.sum(Z**2, axis=0))
    Z, on = Z[:, norm > 0] / norm[norm > 0], np.flatnonzero(np.any(Z, axis=1))
    here, out = Z[on], np.zeros((len(Z), min(len(on), Z.shape[1])))
    by_rows = len(on) < Z.shape[1]
    values, vectors = np.linalg.eigh(here @ here.T if by_rows else here.T @ here)
    good = values > SPANNED * values.max(initial=0.0)
    vectors = vectors[:, good]
    out[np.ix_(on, np.arange(good.sum()))] = vectors if by_rows else here @ (vectors / np.sqrt(values[good]))
    return out[:, : good.sum()]


def whiteners(rows: Rows, residual: np.ndarray, usable: np.ndarray) -> tuple[Whitener, ...]:
    """One whitener a channel, from residuals (C, M) on the `usable` (M,) rows."""
    return tuple(whitener(rows, residual[c], rows.use[c] & usable, rows.use[c]) for c in range(rows.channels))


def whitener(rows: Rows, residual: np.ndarray, counted: np.ndarray, use: np.ndarray) -> Whitener:
    """Noise from the `counted` rows, whitening for every row of `use`."""
    calm = counted & _calm(rows, residual, counted)
    coefficients, covariance, variance = burg(residual, calm, rows.piece, _memory(rows))
    extended = _extend(covariance, coefficients, 2 * max(len(coefficients), 1))
    L = _vecchia(use, rows.piece, extended, len(coefficients))
    return Whitener(L, float(np.sqrt(variance)), coefficients, extended)


def news(rows: Rows, residual: np.ndarray, counted: np.ndarray) -> float:
    """Variance of what the past of a channel's residual (M,) does not foretell, over the `counted` rows."""
    return burg(residual, counted, rows.piece, _memory(rows))[2]


def _memory(rows: Rows) -> int:
    """Rows of the longest correlation that counts as noise."""
    return max(1, round(MEMORY_S / rows.hop))


def _calm(rows: Rows, residual: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """(M,) False in blocks whose innovation-like power exceeds what chance gives the highest of them."""
    key = rows.piece * 1_000_000 + np.floor((rows.t - rows.t.min()) / BLOCK_S).astype(int)
    _, block = np.unique(key, return_inverse=True)
    step = np.where(counted, residual, 0.0)
    n = np.bincount(block, counted)
    power = np.bincount(block, step**2) / np.maximum(n, 1)
    full = n > 0.3 * max(n.max(initial=1), 1)
    if full.sum() < 8:
        return np.ones(len(residual), bool)
    typical = np.median(power[full])
    spread = 1.4826 * np.median(np.abs(np.log(np.maximum(power[full], 1e-300) / max(typical, 1e-300))))
    limit = scipy.stats.norm.isf(1e-3 / full.sum()) * max(spread, 0.2)
    loud = np.log(np.maximum(power, 1e-300) / max(typical, 1e-300)) > limit
    return ~loud[block]


def burg(
    x: np.ndarray, mask: np.ndarray, piece: np.ndarray, longest: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Autoregression of x (M,) over the masked rows -> coefficients (p,), autocovariance (p + 1,), innovation
    variance.

    Each reflection coefficient is the correlation of forward and backward errors over the rows whose whole
    past of that order counts (J. P. Burg, Maximum entropy spectral analysis, 1967, for segments); its gain
    in likelihood is that of those rows, and BIC weighs it against one more parameter."""
    rows = int(mask.sum())
    z = np.where(mask, x - (x[mask].mean() if rows else 0.0), 0.0)
    error = max(float(z @ z) / max(rows, 1), 1e-24)
    a, r = np.zeros(0), [error]
    best, chosen = 0.0, (a, np.array(r), error)
    criterion, forward, backward, whole = 0.0, z, z, mask
    for order in range(1, longest + 1):
        whole = whole[1:] & mask[: len(mask) - order] & (piece[order:] == piece[: len(piece) - order])
        forward, backward = forward[1:], backward[:-1]
        f, b = forward[whole], backward[whole]
        power = float(f @ f + b @ b)
        if len(f) < 2 * order or power <= 0:
            break
        reflection = 2 * float(f @ b) / power
        if not abs(reflection) < 0.9999:
            break
        r.append(reflection * error + float(a @ np.array(r[:0:-1])))
        a = np.append(a - reflection * a[::-1], reflection)
        error *= 1 - reflection**2
        forward, backward = forward - reflection * backward, backward - reflection * forward
        criterion += len(f) * np.log(1 - reflection**2) + np.log(max(rows, 2))
        if criterion < best:
            best, chosen = criterion, (a.copy(), np.array(r), error)
    return chosen


def _extend(r: np.ndarray, a: np.ndarray, longest: int) -> np.ndarray:
    """Autocovariance of the autoregression itself up to a longer lag."""
    out = list(r)
    while len(out) <= longest:
        out.append(float(a @ np.array(out[-1 : -len(a) - 1 : -1])) if len(a) else 0.0)
    return np.array(out)


def _vecchia(use: np.ndarray, piece: np.ndarray, r: np.ndarray, p: int) -> scipy.sparse.csr_array:
    """Whitening rows; those with the same pattern of used predecessors share one small solve."""
    M = len(use)
    places = np.flatnonzero(use)
    if p == 0:
        data = np.full(len(places), 1 / np.sqrt(r[0]))
        return scipy.sparse.csr_array((data, (places, places)), shape=(M, M))
    reach = 2 * p
    lags = np.arange(1, reach + 1)
    before = places[:, None] - lags[None, :]
    there = (
        (before >= 0) & use[np.maximum(before, 0)] & (piece[np.maximum(before, 0)] == piece[places][:, None])
    )
    there &= np.cumsum(there, axis=1) <= p
    packed = np.packbits(there, axis=1)
    _, first, pattern = np.unique(packed, axis=0, return_index=True, return_inverse=True)
    pattern = pattern.ravel()
    i, j, v = [places], [places], np.empty(len(places))
    entries = [v]
    for k, example in enumerate(first):
        mine = np.flatnonzero(pattern == k)
        chosen = lags[there[example]]
        if len(chosen):
            gram = r[np.abs(chosen[:, None] - chosen[None, :])]
            weights = np.linalg.solve(gram + 1e-12 * r[0] * np.eye(len(chosen)), r[chosen])
            variance = max(float(r[0] - weights @ r[chosen]), 1e-9 * r[0])
        else:
            weights, variance = np.zeros(0), float(r[0])
        v[mine] = 1 / np.sqrt(variance)
        if len(chosen):
            here = np.repeat(places[mine], len(chosen))
            i.append(here)
            j.append((places[mine][:, None] - chosen[None, :]).ravel())
            entries.append(np.tile(-weights / np.sqrt(variance), len(mine)))
    return scipy.sparse.csr_array(
        (np.concatenate(entries), (np.concatenate(i), np.concatenate(j))), shape=(M, M)
    )
