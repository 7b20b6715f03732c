"""Where gravity is by all rows that fit or judge, and how well they tell it.

The parameters of every body, gravity's direction, other zeros of joints and other factors of torques are
fitted together by Gauss-Newton steps. A zero or a factor is taken where stretch by stretch more is explained
with it; what is not taken may be there, too, and any torque may be wrong in a way of its own, so that the
direction is as uncertain as with any one of them or without one. (A rokae on a wall was told 7 degrees off.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ident.distributions import f_quantile
from ident.examination.fits.bodies import errors, own_columns, parts_of, torques, with_bodies
from ident.examination.fits.quick import CLUSTERS, Assignment, Fit, Quick, functionals, quick_of
from ident.examination.fits.samples import Sample
from ident.examination.fits.sphere import across, degrees_between, sought
from ident.examination.fits.stretches import ODD, Explained, agreed

SMALL = 1e-4  # rad, of differences
STEPS, NEAR, MOST = 8, 1e-3, 0.5  # of Gauss-Newton: how many, the last one, and the largest
APART = 8.0  # degrees, from which it is another direction
TRIED = 12  # directions across gravity in which it is asked how well it is known
Other = tuple[str, int]  # "zero" of a joint or "factor" of a torque, by its place


@dataclass(frozen=True, slots=True)
class Direction:
    """gravity (3,) m/s^2, in the base's frame, and within how many degrees of it it is with 95 %."""

    gravity: np.ndarray
    within: float


def direction(table: Any, whole: Quick, how: Assignment, start: np.ndarray) -> Direction:
    """whole: rows that are all fitted (`stretches.all_rows`); start (3,) m/s^2, near gravity and of its size.

    First moments make up for gravity that is upside down or elsewhere, but for their part in the inertia:
    what stretch by stretch is not rejected there leaves nothing known. (Of a rokae on a wall whose second
    joint has another zero it was told to hang upside down.)"""
    columns = whole.columns
    turning = [j for j, joint in enumerate(columns.need.joints) if str(joint) not in columns.model.prismatic]
    seen = np.flatnonzero(whole.identify.rows > 10).tolist()
    others: list[Other] = [("zero", j) for j in turning[1:]] + [("factor", c) for c in seen]
    at, *against = _everywhere(table, whole, how, start)
    taken: list[Other] = []
    while True:
        rest = [other for other in others if other not in taken]
        step = _Step.of(at, [*taken, *rest])
        kept = list(range(len(taken)))
        ways = [step.taking([*kept, k]) for k in range(len(taken), len(others))]
        gains = [way.fit.gain_over(at.explained.fit) for way in ways]
        if not rest:
            break
        best = rest[int(np.argmax(gains))]
        more = _descended(at, [*taken, best])
        if not agreed(at.explained, more.explained, ODD / len(others)):
            break
        at, taken = more, [*taken, best]
    for other in against:
        elsewhere = _descended(other, taken)
        if _angle(elsewhere, at) > APART and not agreed(
            elsewhere.explained, at.explained, ODD / len(against)
        ):
            return Direction(at.gravity, 180.0)
    plain = step.taking(kept)
    ways += [step.taking(kept, c) for c in seen] if len(seen) > 1 else []
    within = max(float(np.linalg.norm(way.turn - plain.turn)) + way.spread() for way in (plain, *ways))
    return Direction(at.gravity, float(np.degrees(within)))


@dataclass(frozen=True, slots=True)
class _Model:
    """A table with gravity (3,), zeros (n,) rad and logarithms of factors (C,), and what it explains of rows
    whose own columns (of no body) are `own`."""

    table: Any
    whole: Quick
    how: Assignment
    gravity: np.ndarray
    zeros: np.ndarray
    powers: np.ndarray
    explained: Explained

    @classmethod
    def of(cls, table: Any, whole: Quick, how: Assignment, gravity: np.ndarray) -> _Model:
        zeros, powers = np.zeros(len(whole.columns.need.joints)), np.zeros(len(how.factor))
        return cls(table, whole, how, gravity, zeros, powers, _explained(table, whole, how, gravity, zeros))

    def moved(self, turn: np.ndarray, others: Sequence[tuple[Other, float]]) -> _Model:
        """gravity turned by (2,) rad across it, and some zeros and powers more."""
        size = np.linalg.norm(self.gravity)
        gravity = self.gravity + size * across(self.gravity) @ turn
        gravity = size * gravity / np.linalg.norm(gravity)
        zeros, powers = self.zeros.copy(), self.powers.copy()
        for (kind, k), x in others:
            (zeros if kind == "zero" else powers)[k] += x
        how = Assignment(self.how.order, tuple(np.array(self.how.factor) * np.exp(powers)))
        explained = _explained(self.table, self.whole, how, gravity, zeros)
        return replace(self, gravity=gravity, zeros=zeros, powers=powers, explained=explained)

    def along(self, others: Sequence[Other]) -> Quick:
        """The rows with columns behind the model's: what the torques change by with gravity's turn across
        itself (2), zeros and powers."""
        chi, columns = self.explained.fit.chi, self.whole.columns
        its_own, joint = len(own_columns(columns)), columns.joint_of
        bodies = chi[: len(chi) - its_own]
        turns = np.linalg.norm(self.gravity) * across(self.gravity)
        samples = []
        for s in self.explained.quick.samples:

            def torque(g: np.ndarray, q: np.ndarray, s: Sample = s, rest: float = 1.0) -> np.ndarray:
                table = replace(self.table, gravity=tuple(float(x) for x in g))
                return torques(table, q, rest * s.dq, rest * s.ddq, bodies)[joint].T

            q = s.q + self.zeros
            as_it_is = torque(self.gravity, q)
            more = [torque(g, q, rest=0.0) for g in turns.T]
            for kind, k in others:
                if kind == "zero":
                    step = SMALL * (np.arange(q.shape[1]) == k)
                    more.append((torque(self.gravity, q + step) - as_it_is) / SMALL)
                else:
                    more.append(np.where(np.arange(len(joint)) == k, -s.predicted(chi), 0.0))
            samples.append(s.beside(np.stack(more, axis=2).swapaxes(0, 1)))
        return quick_of(columns, samples)


def _everywhere(table: Any, whole: Quick, how: Assignment, start: np.ndarray) -> list[_Model]:
    """Directions with which all rows are explained better than with any near them, best first."""
    parts = parts_of(table, whole.columns, whole.samples, how)
    assert parts is not None
    found: list[_Model] = []
    for g in (start, -start, *sought(parts, errors(parts, None, start)[0], float(np.linalg.norm(start)))):
        model = _descended(_Model.of(table, whole, how, g), [])
        if all(_angle(model, other) > APART for other in found):
            found.append(model)
    return sorted(found, key=lambda model: -model.explained.fit.gain_over(found[0].explained.fit))


def _angle(one: _Model, other: _Model) -> float:
    return degrees_between(one.gravity, other.gravity)


@dataclass(frozen=True, slots=True)
class _Step:
    """One linear step: rows with columns as `_Model.along` makes them behind the first `plain` ones."""

    quick: Quick
    how: Assignment
    plain: int

    @classmethod
    def of(cls, model: _Model, others: Sequence[Other]) -> _Step:
        return cls(model.along(others), model.explained.how, len(model.explained.fit.chi))

    def taking(self, some: Sequence[int], without: int | None = None) -> _Way:
        """With gravity's turn and some of the others, by their places; without one of the torques."""
        kept = np.r_[0 : self.plain + 2, [self.plain + 2 + k for k in some]].astype(int)
        sums = self.quick.identify
        G, v, rows = sums.G[:, kept[:, None], kept], sums.v[:, :, kept], sums.rows
        if without is not None:
            rows = np.where(np.arange(len(rows)) == without, 0.0, rows)
        quick = replace(self.quick, identify=replace(sums, G=G, v=v, rows=rows))
        return _Way(quick, self.how, quick.fit(self.how), kept, self.plain)


@dataclass(frozen=True, slots=True)
class _Way:
    """What a linear step tells of the columns that are kept."""

    quick: Quick
    how: Assignment
    fit: Fit
    kept: np.ndarray
    plain: int

    @property
    def turn(self) -> np.ndarray:
        """(2,) rad of gravity across itself."""
        return self.fit.chi[self.plain : self.plain + 2]

    @property
    def numbers(self) -> np.ndarray:
        return self.fit.chi[self.plain + 2 :]

    def spread(self) -> float:
        """rad within which the turn is known with 95 % where it is known least."""
        samples = tuple(replace(s, W=s.W[:, :, self.kept]) for s in self.quick.samples)
        angles = np.linspace(0, np.pi, TRIED, endpoint=False)
        H = np.zeros((len(self.kept), TRIED))
        H[self.plain : self.plain + 2] = np.cos(angles), np.sin(angles)
        free = max(2, CLUSTERS // len(samples)) * len(samples) - 1
        times = np.sqrt(2 * f_quantile(0.05, 2, max(free - 1, 1)) * free / max(free - 1, 1))
        return float(
            times * functionals(replace(self.quick, samples=samples), self.fit, self.how, H)[1].max()
        )


def _descended(model: _Model, others: Sequence[Other]) -> _Model:
    """The best direction near the model's, with some zeros and factors free."""
    for _ in range(STEPS):
        way = _Step.of(model, others).taking(range(len(others)))
        x = np.concatenate([way.turn, way.numbers])
        x *= min(1.0, MOST / max(float(np.abs(x).max()), 1e-9))
        after = model.moved(x[:2], list(zip(others, x[2:])))
        if not after.explained.fit.gain_over(model.explained.fit) > 0:
            break
        model = after
        if np.abs(x).max() < NEAR:
            break
    return model


def _explained(
    table: Any, whole: Quick, how: Assignment, gravity: np.ndarray, zeros: np.ndarray
) -> Explained:
    table = replace(table, gravity=tuple(float(x) for x in gravity))
    return Explained.by(with_bodies(table, whole, zeros), how)
