"""Torques with the other sign: what a quick fit shows.

Where joints share links, a wrong torque contradicts the others and the fit says which. A joint that shares
nothing fits as well either way; there friction decides: it takes energy out of the motion, and a moment of
inertia is positive. Both are linear in the parameters, so they have a standard deviation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ident.examination.check import listed, turned_sign
from ident.examination.fits.hypothesis import CLEARLY, Asked, Hypothesis, falls
from ident.examination.fits.quick import Assignment, Fit, Quick, functionals
from ident.examination.fits.samples import regressor
from modelgen.geometry.names import ParameterName

SURE = 5.0  # standard deviations
FRICTION = ("Fvm", "Fcm", "Fvl", "Fcl", "Fvc", "Fcc")
CONFIGURATIONS = 40
MOST_SIGNS = 8  # torques whose signs are all tried together


@dataclass(frozen=True, slots=True)
class Evidence:
    """z values (C,) of the friction's power and of the moment of inertia, NaN where they are not seen."""

    friction: np.ndarray
    inertia: np.ndarray

    def against(self, c: int) -> bool:
        """This channel's torque puts energy in where friction takes it out, or its inertia is negative."""
        f, i = self.friction[c], self.inertia[c]
        if np.isfinite(f) and abs(f) > SURE:
            return bool(f < -SURE and not i > SURE)
        return bool(i < -SURE)

    def speaks_for(self, c: int) -> bool:
        f, i = self.friction[c], self.inertia[c]
        if np.isfinite(f) and abs(f) > SURE:
            return bool(f > SURE and not i < -SURE)
        return bool(i > SURE)


def evidence(quick: Quick, fit: Fit, how: Assignment) -> Evidence:
    """Power of friction and moment of inertia about each joint, in their standard deviations."""
    columns = quick.columns
    C, b = len(columns.channels), len(columns.parameters)
    kinds = [ParameterName.of(name) for name in columns.parameters]
    rubbing = np.array([kind is not None and kind.kind in FRICTION for kind in kinds])
    friction, inertia = np.full(C, np.nan), np.full(C, np.nan)
    s = max(quick.fitted, key=lambda s: len(s.q))
    some = slice(None, None, max(1, len(s.q) // CONFIGURATIONS))
    q = s.q[some]
    none = np.zeros_like(q)
    at_rest = regressor(columns, s.payload, q, none, none, none)
    moved: dict[int, np.ndarray] = {}
    asked: list[tuple[np.ndarray, int, np.ndarray]] = []  # where the answer goes to, and to which vector
    for c in range(C):
        if not quick.identify.rows[c] > 10:
            continue
        j = int(columns.joint_of[c])
        power = np.zeros(b)
        for sample in quick.fitted:
            weight = sample.weight[:, c] * sample.dq[:, j]
            power += np.where(rubbing, weight @ sample.W[c], 0.0)
        if j not in moved:
            ddq = none.copy()
            ddq[:, j] = 1.0
            moved[j] = (regressor(columns, s.payload, q, none, ddq, none) - at_rest).mean(axis=1)
        its_vectors = ((friction, power), (inertia, moved[j][c]))
        asked += [(its, c, vector) for its, vector in its_vectors if np.any(vector)]
    if asked:
        values, stds = functionals(quick, fit, how, np.column_stack([vector for _, _, vector in asked]))
        for (its, c, _), z in zip(asked, values / np.maximum(stds, 1e-300)):
            its[c] = z
    return Evidence(friction, inertia)


def all_signs(asked: Asked) -> Hypothesis | None:
    """Every torque of one side with the other sign: the fit is as good, and everything comes out negative."""
    seen, rows, columns = evidence(asked.quick, asked.fit, asked.how), asked.seen, asked.quick.columns
    against = [c for c in rows if seen.against(c)]
    speaking = [c for c in rows if seen.speaks_for(c)]
    if len(rows) < 2 or speaking or len(against) < max(min(3, len(rows)), 0.55 * len(rows)):
        return None
    which = [c for c in range(len(asked.how.order)) if c not in columns.gain_columns]
    words = "all torques have the other sign"
    joints = listed(columns.channels[c][5:] for c in against)
    said = f"{words}: friction or inertia of joints {joints} come out negative"
    check = turned_sign(asked.names(which), said, asked.maps)
    return Hypothesis(np.inf, asked.how.times(which, -1.0), check, words=words)


def sign_patterns(channels: Sequence[int]) -> list[list[int]]:
    """All choices of channels that may be turned, none first."""
    each = product((0, 1), repeat=len(channels))
    return [[c for c, turned in zip(channels, bits) if turned] for bits in each]


def several_signs(asked: Asked) -> Iterator[Hypothesis]:
    """Two torques or more with the other sign: turning one alone may only move the contradiction.

    A pattern of signs fits as well as its opposite; which of the two is meant inertia and friction say, and
    without them the fewer torques. Of torques that may have either sign none is told."""
    seen, quick, how = asked.seen, asked.quick, asked.how
    if not 3 <= len(seen) <= MOST_SIGNS:
        return
    patterns = sign_patterns(seen[1:])
    fits = quick.fits([how.times(which, -1.0) for which in patterns])
    gains = np.array([other.gain_over(asked.fit) for other in fits])
    sides = _told_sides(seen, [patterns[k] for k in np.flatnonzero(gains > gains.max() - 0.5 * CLEARLY)])
    if min(map(len, sides)) < 2:
        return

    def speaks(which: list[int]) -> tuple[int, int]:
        its = how.times(which, -1.0)
        told = evidence(quick, quick.fit(its), its)
        return sum(told.speaks_for(c) for c in seen) - sum(told.against(c) for c in seen), -len(which)

    which, others = sorted(sides, key=speaks, reverse=True)
    other = quick.fit(how.times(which, -1.0))
    if not asked.better(other, 2 * CLEARLY):
        return
    names, beside = asked.names(which), listed(asked.names(others))
    words = f"{listed(names)} have the other sign than {beside}"
    check = turned_sign(names, f"{words}: turned, {falls(asked.fit, other)}", asked.maps)
    yield Hypothesis(other.gain_over(asked.fit), how.times(which, -1.0), check, words=words)


def _told_sides(seen: Sequence[int], patterns: Sequence[Sequence[int]]) -> tuple[list[int], list[int]]:
    """Torques of one sign and of the other that all these patterns of turned ones have so: of small torques
    some have either. (Of an LWR4+ with two torques turned the fourth was told to be, for the last three may
    have any sign.)"""
    turned = np.array([[c in which for c in seen] for which in patterns])
    beside = [turned ^ turned[:, [k]] for k in range(len(seen))]  # as the k-th, or the other way
    its = max(beside, key=lambda x: (x == x[0]).all(axis=0).sum())
    told = (its == its[0]).all(axis=0)
    return [c for c, x in zip(seen, told & its[0]) if x], [c for c, x in zip(seen, told & ~its[0]) if x]
