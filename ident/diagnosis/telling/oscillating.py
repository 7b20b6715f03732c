"""A residual that oscillates of its own: a vibration, a slosh.

Slow noise forgets: its autocovariance is a sum of relaxations, a exp(-|lag| / T) with a >= 0, and its
spectrum only falls. An oscillation is b exp(-|lag| / T) cos(2 pi f lag) beside it, and has more of the
residual's power than all of these (less of it is the edge of a filter, too). Noise of positions that go in
steps is one of velocities and accelerations behind the filter that the steps ask for: its spectrum rises as
f^2 and f^4 up to there, which is no oscillation either (of an arm with steps of 0.35 mrad one of 2.4 Hz was
told, of another one of 1.3 Hz beside accelerations alone). f, T and b are learned on the fitted rows; what
the judged ones say of it is their Gaussian log-likelihood with it, less that without, the sizes of all noise
at their most likely each time. Both are of contrasts of the rows that no parameter of the model changes: of
slow noise a fit takes up what is slowest, and what it leaves rises with the frequency before it falls. Rows
that do not count are gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from ident.diagnosis.rows.rows import Rows
from ident.signals.low_pass import LowPass

SIZE, LEAST, MOST = 256, 64, 12  # rows of a block, at least; blocks of a side
RELAXATIONS = 5
PERIODS = (1.0, 3.0, 10.0)  # that an oscillation may last
LAGS, FREQUENCIES = 2000, 400  # of an autocovariance, of its spectrum
SEEN = 1e-6  # of a column's size: less of it is none
TURNS = 30  # of the search for the sizes: each raises the likelihood


@dataclass(frozen=True, slots=True)
class Oscillation:
    """Where the spectrum of the fitted rows has it, and what the judged ones say of it."""

    frequency_hz: float
    log_e: float


@dataclass(frozen=True, slots=True)
class Block:
    """Rows that are read together: their times (k,) [s], orthonormal contrasts (k, n) of them, the residual's
    (n,), and their covariance (n, n) whatever the noise."""

    t: np.ndarray
    contrasts: np.ndarray
    residual: np.ndarray
    known: np.ndarray

    def of(self, covariance: np.ndarray) -> np.ndarray:
        """(n, n) of the contrasts, from that of the rows (k, k)."""
        return np.asarray(self.contrasts.T @ covariance @ self.contrasts)


def oscillation(
    hop: float, fitted: Sequence[Block], judged: Sequence[Block], filters: Sequence[LowPass] = ()
) -> Oscillation | None:
    """Of an oscillation, learned on the fitted blocks, the log E on the judged ones; None: the fitted ones
    have none. hop [s]: of the rows; filters: of positions that go in steps."""
    if not fitted or not judged:
        return None
    shapes = [0.0, *np.geomspace(2 * hop, SIZE * hop, RELAXATIONS)]
    noise = [_relaxations(b, shapes) + _of_motion(b, filters) for b in fitted]
    f = _frequency(hop, fitted, shapes, filters)
    learned = []
    for T in (periods / f for periods in PERIODS):
        parts = [[*its, _oscillation(b, f, T)] for b, its in zip(fitted, noise)]
        sizes, likelihood = most_likely(fitted, parts)
        power = sizes * np.sum([[np.trace(part) for part in its] for its in parts], axis=0)
        learned.append((likelihood, T, sizes[-1], power[-1] / power.sum()))
    _, T, size, share = max(learned, key=lambda its: its[0])
    if share < 0.5:
        return None
    noise = [_relaxations(b, shapes) + _of_motion(b, filters) for b in judged]
    beside = [replace(b, known=b.known + size * _oscillation(b, f, T)) for b in judged]
    return Oscillation(f, most_likely(beside, noise)[1] - most_likely(judged, noise)[1])


def blocks(rows: Rows, residual: np.ndarray, on: np.ndarray, columns: np.ndarray) -> list[Block]:
    """Of a channel's residual (M,) over the rows `on` (M,); columns (M, k) of its model."""
    out = []
    for piece in np.unique(rows.piece[on]):
        mine = np.flatnonzero(on & (rows.piece == piece))
        parts = np.array_split(mine, max(1, round(len(mine) / SIZE)))
        out += [part for part in parts if len(part) >= LEAST]
    spread = np.unique(np.linspace(0, len(out) - 1, MOST).round().astype(int)) if out else ()
    return [block(rows.t[part], residual[part], columns[part]) for part in (out[k] for k in spread)]


def block(t: np.ndarray, residual: np.ndarray, columns: np.ndarray) -> Block:
    """Of rows at t (k,), whose model has such columns (k, p)."""
    size = np.linalg.norm(columns, axis=0)
    Q = scipy.linalg.null_space((columns / np.where(size > 0, size, 1.0)).T, rcond=SEEN)
    return Block(t, Q, Q.T @ residual, np.zeros((Q.shape[1],) * 2))


def most_likely(blocks: Sequence[Block], parts: Sequence[Sequence[np.ndarray]]) -> tuple[np.ndarray, float]:
    """Sizes (k,) >= 0 of the parts (k, n, n) of each block's covariance, and the log-likelihood with them.
    Minorisation (H. Zhou and others, J. Comput. Graph. Stat. 28, 2019): no step lowers it."""
    power = float(np.mean(np.concatenate([b.residual**2 for b in blocks])))
    sizes = np.full(len(parts[0]), max(power, 1e-300) / len(parts[0]))
    likelihood = -np.inf
    for _ in range(TURNS):
        likelihood, up, down = 0.0, np.zeros(len(sizes)), np.zeros(len(sizes))
        for b, its in zip(blocks, parts):
            K = b.known + sum(a * part for a, part in zip(sizes, its))
            L = scipy.linalg.cholesky(K + 1e-9 * power * np.eye(len(K)), lower=True, check_finite=False)
            inverse = scipy.linalg.lapack.dpotri(L, lower=True)[0]
            inverse = np.tril(inverse) + np.tril(inverse, -1).T
            e = inverse @ b.residual
            likelihood -= float(np.log(np.diag(L)).sum()) + 0.5 * float(b.residual @ e)
            up += [e @ (part @ e) for part in its]
            down += [np.vdot(inverse, part) for part in its]
        sizes = sizes * np.sqrt(up / np.maximum(down, 1e-300))
    return sizes, likelihood


def _relaxations(b: Block, lasting: Sequence[float]) -> list[np.ndarray]:
    """Covariances (n, n) of unit noise that lasts so long [s]; 0: white."""
    lag = np.abs(b.t[:, None] - b.t)
    return [b.of(np.exp(-lag / T)) if T > 0 else np.eye(len(b.residual)) for T in lasting]


def _of_motion(b: Block, filters: Sequence[LowPass]) -> list[np.ndarray]:
    """Covariances (n, n) of the first two derivatives of white noise behind each of the filters, of unit
    size."""
    lag, out = np.abs(b.t[:, None] - b.t), []
    at = np.linspace(0.0, float(lag.max()), LAGS)
    for its in filters:
        f = np.linspace(0.0, min(4 * its.cutoff_hz, 0.5 * its.rate_hz), FREQUENCIES)
        for spectrum in _rising(its, f):
            R = np.cos(2 * np.pi * np.outer(at, f)) @ (spectrum / spectrum.sum())
            out.append(b.of(np.interp(lag, at, R)))
    return out


def _rising(filter: LowPass, f: np.ndarray) -> list[np.ndarray]:
    """Spectra at f (k,) [Hz] of the first two derivatives of white noise behind a filter."""
    return [f**power * filter.response(f) ** 2 for power in (2, 4)]


def _oscillation(b: Block, f: float, T: float) -> np.ndarray:
    lag = np.abs(b.t[:, None] - b.t)
    return b.of(np.exp(-lag / T) * np.cos(2 * np.pi * f * lag))


def _frequency(
    hop: float, blocks: Sequence[Block], shapes: Sequence[float], filters: Sequence[LowPass]
) -> float:
    """[Hz] of the oscillation beside which the noise's spectra make the mean spectrum most likely
    (P. Whittle, Ark. Mat. 2, 1953). What only stands out of its neighbours may be a millionth of what is
    left: of a torque that swept from 0.6 to 2.4 Hz the noise's tail at 7.9 Hz did."""
    P = np.zeros(SIZE + 1)
    for b in blocks:
        x = np.zeros(2 * SIZE)
        at = np.clip(np.round((b.t - b.t[0]) / hop).astype(int), 0, 2 * SIZE - 1)
        x[at] = (b.contrasts @ b.residual) * np.hanning(len(at))
        P += np.abs(np.fft.rfft(x)) ** 2
    f = np.fft.rfftfreq(2 * SIZE, hop)
    seen = f > 4 / (SIZE * hop)
    tried = f[seen & (f < 0.4 / hop)]
    P, f = P[seen], f[seen]
    noise = [1 / (1 + (2 * np.pi * f * T) ** 2) for T in shapes]
    noise += [spectrum for its in filters for spectrum in _rising(its, f)]
    T = PERIODS[1] / tried[:, None]
    its = sum(1 / (1 + (2 * np.pi * (f + sign * tried[:, None]) * T) ** 2) for sign in (1, -1))
    every = np.broadcast_to(np.stack(noise), (len(tried), len(noise), len(f)))
    parts = np.concatenate([every, np.asarray(its)[:, None]], axis=1)
    parts = parts / parts.sum(axis=2, keepdims=True)
    sizes = np.full(parts.shape[:2], P.sum() / parts.shape[1])
    for _ in range(TURNS):
        S = np.einsum("tk,tkf->tf", sizes, parts)
        up, down = (np.einsum("tkf,tf->tk", parts, x) for x in (P / S**2, 1 / S))
        sizes = sizes * np.sqrt(up / down)
    S = np.einsum("tk,tkf->tf", sizes, parts)
    return float(tried[np.argmin(np.sum(np.log(S) + P / S, axis=1))])
