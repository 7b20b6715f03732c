"""What the torques of one recording may be beside those of the others: turned, exchanged, times a number.

Only right-hand sides of one recording's sums change, so that each of some hundred costs a small solution.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from ident.examination.fits.best_factor import best_factor
from ident.examination.fits.hypothesis import SWAPPED, Asked
from ident.examination.fits.quick import Assignment, Fit, Normal, Quick, gain_of, least_squares
from ident.examination.positions.units import times_too
from ident.examination.rivals.scales import SCALED
from ident.examination.torques.weightless import every


@dataclass(frozen=True, slots=True)
class Reading:
    """Recorded torque k of a recording taken as factor[k] times that of source[k], in words; `changes` of the
    study's columns, what it has to gain, and places of the joints whose drives may have changed instead."""

    check: str
    signals: tuple[str, ...]
    words: str
    changes: Mapping[str, Mapping[str, Any]]
    source: tuple[int, ...]
    factor: tuple[float, ...]
    least: float = SWAPPED
    drives: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Sums:
    """Those of some recordings, of which one's torques are read otherwise."""

    each: tuple[Normal, ...]
    total: Normal
    how: Assignment

    @classmethod
    def of(cls, whole: Quick, how: Assignment) -> Sums:
        return cls(whole.each, whole.identify, how)

    def fits(self, k: int, read: Iterable[tuple[Sequence[int], np.ndarray]]) -> list[Fit]:
        """Of all recordings, with torques of recording k in other places and times a factor each time."""
        own, torques = self.each[k], []
        for source, factor in read:
            order = list(source)
            v = self.total.v - own.v + own.v[:, order] * factor[:, None]
            yy = self.total.yy - own.yy + own.yy[:, order] * factor**2
            torques.append(replace(self.total, v=v, yy=yy).right(self.how))
        return least_squares(self.total, torques)

    def least_errors(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """(C,) relative errors below which no fit of several channels comes: as recorded, and with recording
        k's torque times any number."""
        own, out = self.each[k], []
        for c, place in enumerate(self.how.order):
            v = np.stack([self.total.v[c, place] - own.v[c, place], own.v[c, place]], axis=1)
            size = np.array([self.total.yy[c, place] - own.yy[c, place], own.yy[c, place]])
            both = (v.sum(axis=1, keepdims=True), size.sum(keepdims=True)), (v, size)
            out.append([_least_error(self.total.G[c], *its) for its in both])
        return np.array(out)[:, 0], np.array(out)[:, 1]


def _least_error(G: np.ndarray, v: np.ndarray, size: np.ndarray) -> float:
    """Of the sum of L torques on rows of their own, each times any number, with W' Y (b, L), |Y|^2 (L,)."""
    length = np.sqrt(np.maximum(np.diag(G), 1e-300))
    normal = G / np.outer(length, length) + np.diag(np.where(np.diag(G) > 0, 1e-12, 1.0))
    u = v / length[:, None] / np.sqrt(np.maximum(size, 1e-300))
    left = np.eye(len(size)) - u.T @ np.linalg.solve(normal, u)
    return float(np.sqrt(max(np.linalg.eigvalsh(left)[0], 0.0)))


def readings(asked: Asked, sums: Sums, k: int, before: Fit) -> Iterator[tuple[float, Reading]]:
    """What recording k's torques may be, each with the gain over `before` that all recordings then show. A
    number is not looked for where none gains enough to be told."""
    all_told = [*_turned(asked), *_exchanged(asked)]
    for fit, its in zip(sums.fits(k, [(its.source, np.array(its.factor)) for its in all_told]), all_told):
        yield fit.gain_over(before), its
    every = [c for c in asked.seen if c not in asked.quick.columns.gain_columns]
    plain, times = sums.least_errors(k)
    for channels in [[c] for c in asked.seen] + ([every] if len(every) > 1 else []):
        least = np.where(np.isin(np.arange(len(plain)), channels), times, plain)
        if gain_of(before.error, least) > SCALED:
            yield _scaled(asked, sums, k, before, channels)


def _turned(asked: Asked) -> Iterator[Reading]:
    """One torque, or all. (Of a Barrett with all torques of one recording turned they were told as 1 s late
    in all, or two of each as turned.)"""
    n = len(asked.how.order)
    for which in every(asked.seen):
        places = [asked.how.order[c] for c in which]
        factor = tuple(-1.0 if k in places else 1.0 for k in range(n))
        names = asked.names(which)
        words = f"{names[0]} has the other sign" if len(which) == 1 else "all torques have the other sign"
        changes = {name: {"sign": -1} for name in names}
        yield Reading("torque_sign", names, words, changes, tuple(range(n)), factor)


def _exchanged(asked: Asked) -> Iterator[Reading]:
    """Two torques of one side; a current is then times the gain of its own drive."""
    order, gains, channels = asked.how.order, asked.gains, asked.quick.columns.need.channels
    for a, b in combinations(asked.seen, 2):
        if channels[a].side == channels[b].side:
            source, factor = list(range(len(order))), [1.0] * len(order)
            source[order[a]], source[order[b]] = order[b], order[a]
            factor[order[a]], factor[order[b]] = float(gains[a] / gains[b]), float(gains[b] / gains[a])
            one, other = asked.name(a), asked.name(b)
            changes = {one: {"of": other}, other: {"of": one}}
            words = f"{one} and {other} look swapped"
            yield Reading("swapped_signals", (one, other), words, changes, tuple(source), tuple(factor))


def _scaled(asked: Asked, sums: Sums, k: int, before: Fit, channels: Sequence[int]) -> tuple[float, Reading]:
    """These torques times the number with which all recordings are explained best; no gain where it is hardly
    more than that of an absurd one."""
    order = asked.how.order
    same, own = tuple(range(len(order))), np.isin(np.arange(len(order)), [order[c] for c in channels])

    def gains(factors: np.ndarray) -> list[float]:
        fits = sums.fits(k, [(same, np.where(own, by, 1.0)) for by in factors])
        return [fit.gain_over(before) for fit in fits]

    best = best_factor(gains)
    names, size = asked.names(channels), float(f"{best.factor:.3g}")
    plain = f"{names[0]} is" if len(names) == 1 else "all torques are"
    words = f"{plain} {times_too(1 / best.factor)}"
    changes, factor = {name: {"scale": size} for name in names}, tuple(np.where(own, size, 1.0).tolist())
    drives = tuple(int(asked.quick.columns.joint_of[c]) for c in channels)
    most = best.gain if best.gain - best.absurd > SCALED else 0.0
    return most, Reading("torque_scale", names, words, changes, same, factor, SCALED, drives)
