"""A quick fit on some thousand samples, and what it costs to fit the same samples under another hypothesis.

Every channel's normal matrix is made once, recording by recording. A torque with another sign, another scale
or in another's place changes only right-hand sides, so each hypothesis costs one small solution. Channels
are weighted by what the fit leaves of them (three turns), and two fits are compared by

    gain = sum over channels of ln(error before / error after),   error = ||Y - W chi|| / ||Y||,

in which halving the error of one channel is 0.69 whatever the size of its torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ident.equations.columns import Columns
from ident.examination.fits.samples import Sample

FLOOR = 3e-3  # errors below it are not told apart
CLUSTERS = 20  # stretches of one recording whose scores are taken as independent
RIDGE = 1e-10


@dataclass(frozen=True, slots=True)
class Assignment:
    """Which recorded torque stands in which channel, times what: a hypothesis about torques."""

    order: tuple[int, ...]
    factor: tuple[float, ...]

    @classmethod
    def plain(cls, channels: int) -> Assignment:
        return cls(tuple(range(channels)), (1.0,) * channels)

    def times(self, channels: Sequence[int], factor: float) -> Assignment:
        values = list(self.factor)
        for c in channels:
            values[c] *= factor
        return Assignment(self.order, tuple(values))

    def placed(self, source: Sequence[int], gains: np.ndarray) -> Assignment:
        """Channel c with the torque of channel source[c]: a current is then times the gain (C,) of its own
        drive."""
        factors = (self.factor[k] * float(gains[c] / gains[k]) for c, k in enumerate(source))
        return Assignment(tuple(self.order[k] for k in source), tuple(factors))


@dataclass(frozen=True, slots=True)
class Fit:
    """chi (b,), error (C,) on identify, validate (C,) or None, and its normal matrix."""

    chi: np.ndarray
    error: np.ndarray
    validate: np.ndarray | None
    normal: np.ndarray  # (b, b), of columns divided by `length`
    length: np.ndarray
    scale: np.ndarray  # (C,) 1 / variance of the channels

    @property
    def inverse(self) -> np.ndarray:
        return np.linalg.inv(self.normal) / np.outer(self.length, self.length)

    def of_channel(self, c: int) -> Fit:
        """As if nothing of the other torques were seen."""
        held = None if self.validate is None else self.validate[[c]]
        return replace(self, error=self.error[[c]], validate=held)

    def gain_over(self, other: Fit) -> float:
        return gain_of(other.error, self.error)

    def holds_over(self, other: Fit) -> float:
        """The same on the validate recordings; on identify where there are none."""
        if self.validate is None or other.validate is None:
            return self.gain_over(other)
        return gain_of(other.validate, self.validate)


def gain_of(before: np.ndarray, after: np.ndarray) -> float:
    """Sum of ln(before / after) of errors (C,) over the channels that both have."""
    return float(np.sum(gains_of(before, after)))


def gains_of(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(C,) ln(before / after) of errors (C,); 0 of channels that not both have."""
    seen = np.isfinite(before) & np.isfinite(after)
    return np.where(seen, np.log(np.maximum(before, FLOOR) / np.maximum(after, FLOOR)), 0.0)


@dataclass(frozen=True, slots=True)
class Normal:
    """Sums over samples: G (C, b, b), v (C, C, b) = W_c' Y_k, yy (C, C) = |Y_k|^2 in rows of c."""

    G: np.ndarray
    v: np.ndarray
    yy: np.ndarray
    rows: np.ndarray

    @classmethod
    def of(cls, s: Sample) -> Normal:
        C, N, b = s.W.shape
        G, v, yy = np.zeros((C, b, b)), np.zeros((C, C, b)), np.zeros((C, C))
        room, root = np.empty((b + C, N)), np.sqrt(s.weight.T)
        for c in range(C):
            columns = s.W[c].T  # (b, N), row after row in memory
            live = np.flatnonzero(columns.any(axis=1))  # a torque feels no link before its joint
            L = len(live)
            seen = room[: L + C]
            np.take(columns, live, axis=0, out=seen[:L], mode="clip")  # which copies once
            seen[L:] = s.Y.T
            seen *= root[c]
            sums = seen @ seen.T
            G[c, live[:, None], live], v[c][:, live] = sums[:L, :L], sums[L:, :L]
            yy[c] = sums.diagonal()[L:]
        return cls(G, v, yy, s.weight.sum(axis=0))

    def partly(self, other: Normal, channels: Sequence[int]) -> Normal:
        """With the other's sums of some channels, of the same torques."""
        G, v = self.G.copy(), self.v.copy()
        G[channels], v[channels] = other.G[channels], other.v[channels]
        return replace(self, G=G, v=v)

    def right(self, how: Assignment) -> tuple[np.ndarray, np.ndarray]:
        """(C,) |Y|^2 and (C, b) W' Y of the torques that the channels then have."""
        each, factor = (np.arange(len(how.order)), list(how.order)), np.array(how.factor)
        return factor**2 * self.yy[each], factor[:, None] * self.v[each]

    def size_beside(self, other: Normal, how: Assignment) -> np.ndarray:
        """(C,) |Y| of the torques that the channels then have, over those of other recordings; 1 where there
        are none."""
        mine, its = self.right(how)[0], other.right(how)[0]
        left = np.maximum(mine, 0.0)  # where all is taken away rounding leaves less than none
        return np.sqrt(np.where(its > 0, left / np.where(its > 0, its, 1.0), 1.0))

    def errors(self, chi: np.ndarray, how: Assignment) -> np.ndarray:
        """(C,) relative; NaN where nothing is seen."""
        size, v = self.right(how)
        return self.left(chi[None], size[None], v[None])[0]

    def left(self, chi: np.ndarray, size: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(K, C), the same by each of chi (K, b) of torques with |Y|^2 (K, C) and W' Y (K, C, b)."""
        C, b, _ = self.G.shape
        along = (self.G.reshape(-1, b) @ chi.T).reshape(C, b, -1)
        left = size - 2 * (v @ chi[:, :, None])[:, :, 0] + np.einsum("cbk,kb->kc", along, chi)
        seen = (self.rows > 10) & (size > 0)
        return np.where(seen, np.sqrt(np.maximum(left, 0.0) / np.where(seen, size, 1.0)), np.nan)


@dataclass(frozen=True, slots=True)
class Quick:
    """The samples of a study and their sums: of each, and of all that are fitted or judge."""

    columns: Columns
    samples: tuple[Sample, ...]
    each: tuple[Normal, ...]
    identify: Normal
    validate: Normal | None

    @property
    def fitted(self) -> tuple[Sample, ...]:
        return tuple(s for s in self.samples if s.role == "identify")

    def plain(self) -> Assignment:
        return Assignment.plain(len(self.columns.channels))

    def fit(self, how: Assignment) -> Fit:
        return solve(self.identify, self.validate, how)

    def fit_beside(self, recorded: Quick, how: Assignment) -> Fit:
        """The same, its errors shares of the torques that were recorded: a small torque with a large one
        added has small errors whatever explains it. (Of an LWR4+ with two rows of its table exchanged its
        second position was the sum of the first two.)"""
        fit = self.fit(how)
        error, held = fit.error * self.identify.size_beside(recorded.identify, how), fit.validate
        if held is not None and self.validate is not None and recorded.validate is not None:
            held = held * self.validate.size_beside(recorded.validate, how)
        return replace(fit, error=error, validate=held)

    def fits(self, hows: Sequence[Assignment]) -> list[Fit]:
        """One under each of these hypotheses about torques."""
        return solve_each(self.identify, self.validate, hows)

    def alone(self, how: Assignment) -> np.ndarray:
        """(C,) errors of every channel fitted by itself, below which no fit of all comes."""
        size, v = self.identify.right(how)
        its = zip(self.identify.G, v, size)
        return np.concatenate([alone(G, right[:, None], np.array([norm])) for G, right, norm in its])

    def of(self, samples: Sequence[Sample]) -> Quick:
        """Other samples; most hypotheses change one, and the sums of the others are known."""
        return _summed(self.columns, samples, list(zip(self.samples, self.each)))

    def partly(self, other: Quick, channels: Sequence[int]) -> Quick:
        """With what the other, of the same torques, has of the model in some channels."""
        samples = [a.partly(b, channels) for a, b in zip(self.samples, other.samples)]
        each = [a.partly(b, channels) for a, b in zip(self.each, other.each)]
        return _together(self.columns, samples, each)

    def moved(self, order: Sequence[int] | None = None, factor: Any = 1.0, offset: Any = 0.0) -> Quick:
        """Along other positions: `Sample.moved`."""
        return self.of([s.moved(self.columns, order, factor, offset) for s in self.samples])


def quick_of(columns: Columns, samples: Sequence[Sample]) -> Quick:
    return _summed(columns, samples, [])


def _summed(columns: Columns, samples: Sequence[Sample], known: Sequence[tuple[Sample, Normal]]) -> Quick:
    each = [next((sums for its, sums in known if s.is_summed_as(its)), None) or Normal.of(s) for s in samples]
    return _together(columns, samples, each)


def _together(columns: Columns, samples: Sequence[Sample], each: Sequence[Normal]) -> Quick:
    of = {role: [n for s, n in zip(samples, each) if s.role == role] for role in ("identify", "validate")}
    judged = added(of["validate"]) if of["validate"] else None
    return Quick(columns, tuple(samples), tuple(each), added(of["identify"]), judged)


def added(normals: Sequence[Normal]) -> Normal:
    """Those of several recordings together."""
    first = normals[0]
    for n in normals[1:]:
        first = Normal(first.G + n.G, first.v + n.v, first.yy + n.yy, first.rows + n.rows)
    return first


def solve(identify: Normal, validate: Normal | None, how: Assignment) -> Fit:
    """Least squares of all channels, weighted three times by what it leaves."""
    return solve_each(identify, validate, [how])[0]


def solve_each(identify: Normal, validate: Normal | None, hows: Sequence[Assignment]) -> list[Fit]:
    """The same under several hypotheses about torques."""
    fits = least_squares(identify, [identify.right(how) for how in hows])
    if validate is not None:
        fits = [replace(fit, validate=validate.errors(fit.chi, how)) for fit, how in zip(fits, hows)]
    return fits


def least_squares(sums: Normal, torques: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Fit]:
    """The same of several torques with |Y|^2 (C,) and W' Y (C, b): a product for all of them."""
    C, b, _ = sums.G.shape
    size, right = (np.stack(each) for each in zip(*torques))  # (K, C), (K, C, b)
    seen = (sums.rows > 10) & (size > 0)
    scale = np.where(seen, 1.0 / np.maximum(size, 1e-300), 0.0)
    for turn in range(3):
        G = (scale @ sums.G.reshape(C, -1)).reshape(-1, b, b)
        own = G.diagonal(axis1=1, axis2=2)
        live = own > 1e-20 * own.max(axis=1, keepdims=True)  # a joint at rest shows nothing of itself
        length = np.where(live, np.sqrt(np.maximum(own, 0.0)), np.inf)
        G /= length[:, None]
        G /= length[:, :, None]
        G.reshape(len(G), -1)[:, :: b + 1] += np.where(live, RIDGE, 1.0)
        aim = (scale[:, None] @ right)[:, 0] / length
        chi = np.linalg.solve(G, aim[:, :, None])[:, :, 0] / length
        error = sums.left(chi, size, right)
        if turn < 2:
            scale = np.where(seen, 1.0 / (np.maximum(size, 1e-300) * np.fmax(error, 0.02) ** 2), 0.0)
    return [Fit(x, e, None, *its) for x, e, *its in zip(chi, error, G, length, scale)]


def alone(G: np.ndarray, v: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(L,) relative errors of one channel fitted by itself, to L torques with W' Y (b, L) and |Y|^2 (L,): no
    fit of several channels leaves less of it."""
    own = np.diag(G)
    length = np.sqrt(np.maximum(own, 1e-300))
    normal = G / np.outer(length, length) + np.diag(np.where(own > 0, 1e-12, 1.0))
    v = v / length[:, None]
    left = size - (v * np.linalg.solve(normal, v)).sum(axis=0)
    return np.sqrt(np.maximum(left, 0.0) / np.maximum(size, 1e-300))


def functionals(quick: Quick, fit: Fit, how: Assignment, H: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(F,) H' chi of the columns of H (b, F), and their standard deviations from the scatter of the scores
    between stretches of the recordings."""
    meat = np.zeros(H.shape[1])
    directions = np.column_stack([fit.chi, fit.inverse @ H])
    for s in quick.fitted:
        scores = np.zeros((len(s.q), H.shape[1]))
        for c, (k, f) in enumerate(zip(how.order, how.factor)):
            seen = s.W[c] @ directions
            left = f * s.Y[:, k] - seen[:, 0]
            scores += (fit.scale[c] * s.weight[:, c] * left)[:, None] * seen[:, 1:]
        pieces = np.array_split(scores, max(2, CLUSTERS // len(quick.fitted)))
        meat += sum(piece.sum(axis=0) ** 2 for piece in pieces)
    return H.T @ fit.chi, np.sqrt(meat)
