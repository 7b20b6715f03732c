"""Whether stretches of the recordings, one like another, are explained better by one fit than by another.

Residuals are correlated over a stretch, hardly beyond it, so that stretches count as samples of a t test.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ident.distributions import t_beyond
from ident.examination.fits.quick import CLUSTERS, Assignment, Fit, Quick, gains_of
from ident.examination.fits.samples import Sample

RIDGE = 1e-10
ODD = 0.05  # rate at which chance confirms what something else has told before
RARE = 1e-3  # rate at which chance leaves one name where there are two
ROUNDING = 1e-6  # mean gain of a stretch that is none
HALF = 0.5  # of what is told, from which something else may be there in its place


def all_rows(quick: Quick) -> Quick:
    """What is fitted and what judges, as one."""
    return quick.of([replace(s, role="identify") for s in quick.samples if s.role != "test"])


@dataclass(frozen=True)
class Explained:
    """Recordings, a fit of them, and what it took of their torques. recorded: those in which nothing was
    taken from a torque; errors are shares of what there was, or what takes most of a torque away explains
    least of the rest."""

    quick: Quick
    fit: Fit
    how: Assignment
    recorded: Quick | None = None

    @classmethod
    def by(cls, quick: Quick, how: Assignment) -> Explained:
        return cls(quick, quick.fit(how), how)

    @classmethod
    def less(cls, quick: Quick, how: Assignment, recorded: Quick) -> Explained:
        """Recordings from whose torques something is taken."""
        return cls(quick, quick.fit_beside(recorded, how), how, recorded)

    def predicted(self, s: Sample) -> np.ndarray:
        """(N, C) N m."""
        return s.predicted(self.fit.chi)

    def gains_over(self, before: Explained) -> np.ndarray:
        """(C,) ln(error before / error) of every torque."""
        return gains_of(before.fit.error, self.fit.error)

    @cached_property
    def stretches(self) -> tuple[np.ndarray, ...]:
        """(stretches, C) of every recording that is fitted: sums of squared errors, as shares of a torque's
        mean square."""
        k, f, size = list(self.how.order), np.array(self.how.factor), self._mean_square
        out = []
        for s in self.quick.fitted:
            squares = s.weight * (f * s.Y[:, k] - self.predicted(s)) ** 2 / size
            ends = [len(rows) for rows in pieces(self.quick, s)]
            out.append(np.add.reduceat(squares, np.cumsum([0, *ends[:-1]]), axis=0))
        return tuple(out)

    @cached_property
    def sizes(self) -> tuple[np.ndarray, ...]:
        """(C,) of every recording that is fitted: a torque's mean square there, as a share of that of all; 1
        where there is none."""
        k, f = list(self.how.order), np.array(self.how.factor)
        out = []
        for s in (self.recorded or self.quick).fitted:
            square = (s.weight * (f * s.Y[:, k]) ** 2).sum(axis=0) / np.maximum(s.weight.sum(axis=0), 1.0)
            out.append(np.where(square > 0, square / self._mean_square, 1.0))
        return tuple(out)

    @cached_property
    def _mean_square(self) -> np.ndarray:
        """(C,) of every torque, N m squared."""
        its = (self.recorded or self.quick).identify
        k, f, c = list(self.how.order), np.array(self.how.factor), np.arange(len(self.how.order))
        return np.maximum(f * f * its.yy[c, k] / np.maximum(its.rows, 1.0), 1e-300)


@dataclass(frozen=True)
class ByItself(Explained):
    """The same with parameters of its own for every torque, (C, b): neither its sign nor its factor matters,
    and no other torque."""

    own: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def by(cls, quick: Quick, how: Assignment) -> ByItself:
        size, v = quick.identify.right(how)
        chi = by_each(quick.identify.G, v)
        left = np.sqrt(np.maximum(size - (v * chi).sum(axis=1), 0.0) / np.maximum(size, 1e-300))
        seen = (quick.identify.rows > 10) & (size > 0)
        fit = replace(quick.fit(how), error=np.where(seen, left, np.nan))
        return cls(quick, fit, how, None, chi)

    def predicted(self, s: Sample) -> np.ndarray:
        return np.stack([W @ chi for W, chi in zip(s.W, self.own)], axis=1)


def by_each(G: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(C, b) least squares of normal matrices G (C, b, b) and right-hand sides v (C, b)."""
    k = np.arange(v.shape[1])
    length = np.sqrt(np.maximum(G[:, k, k], 1e-300))
    normal = G / length[:, :, None] / length[:, None, :]
    normal[:, k, k] += np.where(length > 1e-140, RIDGE, 1.0)
    return np.asarray(np.linalg.solve(normal, (v / length)[:, :, None])[:, :, 0] / length)


def stretch_gains(one: Explained, other: Explained, but: int | None = None) -> np.ndarray:
    """(stretches,) by how much more the other explains of each stretch: falls of the squared errors, in units
    of what the two leave; of all torques but one."""
    left = one.fit.error * other.fit.error
    seen = np.isfinite(left) & (left > 0)
    seen[[] if but is None else [but]] = False
    falls = [0.5 * (x - y)[:, seen] / left[seen] for x, y in zip(one.stretches, other.stretches)]
    return np.concatenate([fall.sum(axis=1) for fall in falls])


def agreed(one: Explained, other: Explained, rate: float) -> bool:
    """Whether stretches of the recordings are explained better by the other fit, but for chance at this
    rate."""
    return beyond_chance(stretch_gains(one, other), rate)


def steadily(one: Explained, other: Explained, rate: float) -> bool:
    """The same by logarithms of what is left of every torque in each stretch, so that no stretch says more
    than another: a fault shows all along. They are of shares of the recording's own torque. (Of an LWR4+ of
    which one run had its first torque 1000 times too large that left less of each other run, as shares of
    all, than its being taken so: another friction in that run stood before it.)"""
    seen = np.isfinite(one.fit.error)
    logs = [
        0.5 * (np.log(np.maximum(x, 1e-300) / np.maximum(y, 1e-300)) - np.log(a / b))[:, seen]
        for x, y, a, b in zip(one.stretches, other.stretches, one.sizes, other.sizes)
    ]
    return beyond_chance(np.concatenate([gain.sum(axis=1) for gain in logs]), rate)


def half_of(before: Explained, told: Explained, other: Explained) -> bool:
    """Whether the other explains at least half of what is told does, of the same torques."""
    its, own = other.gains_over(before), told.gains_over(before)
    same = np.minimum(its, own).clip(0).sum()
    return bool(its.sum() > HALF * own.sum() and same > HALF * own.clip(0).sum())


def same(one: Explained, other: Explained, share: float) -> bool:
    """Whether two leave the same of every torque, but for this share: they are one explanation."""
    return bool(np.allclose(one.fit.error, other.fit.error, rtol=share, atol=0.0, equal_nan=True))


def pieces(quick: Quick, s: Sample) -> list[np.ndarray]:
    """Rows of the stretches of a recording that is fitted."""
    return np.array_split(np.arange(len(s.q)), max(2, CLUSTERS // len(quick.fitted)))


def beyond_chance(gains: np.ndarray, rate: float) -> bool:
    """Whether the mean of gains (stretches,) is positive, but for chance at this rate: Student's t."""
    if len(gains) < 3 or not gains.mean() > ROUNDING:
        return False
    t = gains.mean() / (gains.std(ddof=1) / np.sqrt(len(gains)))
    return t_beyond(float(t), len(gains) - 1) < rate


def confirmed(quick: Quick, how: Assignment, other: Quick, its: Assignment, asked: int) -> bool:
    """Whether stretch by stretch what fits and what judges is explained better by one of so many hypotheses
    that were asked."""
    return agreed(Explained.by(all_rows(quick), how), Explained.by(all_rows(other), its), ODD / asked)
