"""Whether stretches of the recordings, one like another, are explained better by one fit than by another.

Residuals are correlated over a stretch, hardly beyond it, so that stretches count as samples of a t test.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ident.distributions import t_beyond
from ident.examination.quick import CLUSTERS, Assignment, Fit, Normal, Quick, Sample

RIDGE = 1e-10
ODD = 0.05  # rate at which chance confirms what something else has told before
RARE = 1e-3  # rate at which chance leaves one name where there are two


def all_rows(quick: Quick) -> Quick:
    """What is fitted and what judges, as one."""
    return quick.of([replace(s, role="identify") for s in quick.samples if s.role != "test"])


@dataclass(frozen=True, slots=True)
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
        fit = quick.fit(how)
        error = fit.error * quick.identify.size_beside(recorded.identify, how)
        return cls(quick, replace(fit, error=error), how, recorded)

    def squares(self, s: Sample, c: int) -> np.ndarray:
        """(N,) squared errors of a channel of one of the recordings, as shares of its mean square."""
        k, f, its = self.how.order[c], self.how.factor[c], (self.recorded or self.quick).identify
        size = f * f * its.yy[c, k] / max(its.rows[c], 1.0)
        return s.weight[:, c] * (f * s.Y[:, k] - s.W[c] @ self.fit.chi) ** 2 / max(size, 1e-300)


@dataclass(frozen=True, slots=True)
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

    def errors(self, sums: Normal) -> np.ndarray:
        """(C,) relative errors of other recordings."""
        return np.array([sums.errors(chi, self.how)[c] for c, chi in enumerate(self.own)])

    def squares(self, s: Sample, c: int) -> np.ndarray:
        its = replace(self.fit, chi=self.own[c])
        return Explained(self.quick, its, self.how).squares(s, c)


def by_each(G: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(C, b) least squares of normal matrices G (C, b, b) and right-hand sides v (C, b)."""
    k = np.arange(v.shape[1])
    length = np.sqrt(np.maximum(G[:, k, k], 1e-300))
    normal = G / length[:, :, None] / length[:, None, :]
    normal[:, k, k] += np.where(length > 1e-140, RIDGE, 1.0)
    return np.asarray(np.linalg.solve(normal, (v / length)[:, :, None])[:, :, 0] / length)


def stretch_gains(one: Explained, other: Explained) -> np.ndarray:
    """(stretches,) by how much more the other explains of each stretch: falls of the squared errors, in units
    of what the two leave."""
    out: list[float] = []
    for s, its in zip(one.quick.fitted, other.quick.fitted):
        gain = np.zeros(len(s.q))
        for c, left in enumerate(one.fit.error * other.fit.error):
            if np.isfinite(left) and left > 0:
                gain += 0.5 * (one.squares(s, c) - other.squares(its, c)) / left
        out += [float(gain[rows].sum()) for rows in pieces(one.quick, s)]
    return np.array(out)


def agreed(one: Explained, other: Explained, rate: float) -> bool:
    """Whether stretches of the recordings are explained better by the other fit, but for chance at this
    rate."""
    return beyond_chance(stretch_gains(one, other), rate)


def steadily(one: Explained, other: Explained, rate: float) -> bool:
    """The same by logarithms of what is left of every torque in each stretch, so that no stretch says more
    than another: a fault shows all along."""
    gains = []
    for s, its in zip(one.quick.fitted, other.quick.fitted):
        its_rows = pieces(one.quick, s)
        gain = np.zeros(len(its_rows))
        for c in np.flatnonzero(np.isfinite(one.fit.error)).tolist():
            before, after = (
                [max(x[k].sum(), 1e-300) for k in its_rows]
                for x in (one.squares(s, c), other.squares(its, c))
            )
            gain = gain + 0.5 * np.log(np.divide(before, after))
        gains.append(gain)
    return beyond_chance(np.concatenate(gains), rate)


def pieces(quick: Quick, s: Sample) -> list[np.ndarray]:
    """Rows of the stretches of a recording that is fitted."""
    return np.array_split(np.arange(len(s.q)), max(2, CLUSTERS // len(quick.fitted)))


def beyond_chance(gains: np.ndarray, rate: float) -> bool:
    """Whether the mean of gains (stretches,) is positive, but for chance at this rate: Student's t."""
    if len(gains) < 3 or not gains.mean() > 0:
        return False
    t = gains.mean() / (gains.std(ddof=1) / np.sqrt(len(gains)))
    return t_beyond(float(t), len(gains) - 1) < rate


def confirmed(quick: Quick, how: Assignment, other: Quick, its: Assignment, asked: int) -> bool:
    """Whether stretch by stretch what fits and what judges is explained better by one of so many hypotheses
    that were asked."""
    return agreed(Explained.by(all_rows(quick), how), Explained.by(all_rows(other), its), ODD / asked)
