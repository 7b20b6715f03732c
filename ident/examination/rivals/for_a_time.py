"""Torques that for a time are not what all the rest of the recordings asks for: a hand, a collision, a load.

All recordings are cut into stretches. Each is foretold by a fit of all others, and one that leaves most of a
torque opens a window, which takes up its neighbours as long as they stand out as well. What is left there has
to be several times what any other stretch leaves, and in the fit of all, too: what one stretch alone shows is
badly foretold, and explained. (Of a UR10e that was pushed for ten of fifty seconds 17 % were left for 5, and
nothing was said. Of eleven arms as they are, in two hundred logs, it was 2.6 times at most.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.hypothesis import BAD, Asked
from ident.examination.fits.quick import Assignment, Normal, solve
from ident.examination.fits.samples import Sample
from ident.examination.fits.stretches import HALF, all_rows, pieces
from ident.examination.fits.unexplained import ODD, TIMES

OPEN = 2.0  # times what any stretch outside leaves, from which a neighbour belongs to a window


@dataclass(frozen=True, slots=True)
class Stretches:
    """Those of all recordings: rows, sums, whose they are, and what a fit of all leaves of each (K, C), as
    shares of the torques' size (C,)."""

    samples: tuple[Sample, ...]
    sums: tuple[Normal, ...]
    total: Normal
    how: Assignment
    size: np.ndarray
    joint: np.ndarray

    @classmethod
    def of(cls, asked: Asked) -> Stretches:
        whole, how = all_rows(asked.quick), asked.how
        samples = tuple(s.rows(rows) for s in whole.samples for rows in pieces(whole, s))
        sums = tuple(Normal.of(s) for s in samples)
        with np.errstate(invalid="ignore", divide="ignore"):
            size = np.sqrt(whole.identify.right(how)[0] / whole.identify.rows)
        chi = whole.fit(how).chi
        return cls(samples, sums, whole.identify, how, size, _left(sums, how, size, chi))

    def without(self, some: Sequence[int]) -> np.ndarray:
        """chi (b,) of all others."""
        G, v, yy, rows = (
            getattr(self.total, name) - sum(getattr(self.sums[k], name) for k in some)
            for name in ("G", "v", "yy", "rows")
        )
        return solve(Normal(G, v, yy, rows), None, self.how).chi

    def foretold(self, window: Sequence[int]) -> np.ndarray:
        """(K, C) what is left of stretches by fits of all outside a window, and without themselves."""
        inside = self.without(window)
        every = range(len(self.sums))
        each = [inside if k in window else self.without([*window, k]) for k in every]
        left = [_left([its], self.how, self.size, chi)[0] for its, chi in zip(self.sums, each)]
        return np.array(left)

    def window(self, first: int) -> tuple[list[int], np.ndarray] | None:
        """The stretches about one that stand out by some torque, less than half of them all, and what is left
        of all stretches by fits of those outside (`foretold`)."""
        found = [first]
        while len(found) < HALF * len(self.sums):
            left, recording = self.foretold(found), self.samples[first].label
            near = [k for k in (min(found) - 1, max(found) + 1) if 0 <= k < len(left)]
            near = [k for k in near if self.samples[k].label == recording]
            outside = np.delete(left, [*found, *near], 0).max(axis=0)  # or one end hides the other
            near = [k for k in near if (left[k] > OPEN * outside).any()]
            if not near:
                return found, left
            found = sorted([*found, *near])
        return None

    def moves_elsewhere(self, window: Sequence[int]) -> bool:
        """Whether every joint goes half as fast in a stretch outside as within."""
        rates = np.array([np.sqrt(np.mean(s.dq**2, axis=0)) for s in self.samples])
        its = np.isin(np.arange(len(rates)), window)
        return bool((rates[~its].max(axis=0) >= HALF * rates[its].max(axis=0)).all())


def for_a_time(asked: Asked) -> Iterator[Check]:
    """The window in which a torque stands out most, with all torques that do there."""
    its = Stretches.of(asked)
    if len(its.sums) < 4:
        return
    alone = its.foretold([])
    told: list[tuple[float, list[int], list[int], np.ndarray, np.ndarray]] = []
    for begun in sorted({int(np.argmax(np.nan_to_num(alone[:, c]))) for c in asked.seen}):
        about = its.window(begun)
        if about is None:
            continue
        window, left = about
        if not its.moves_elsewhere(window):
            continue
        here, there = _apart(left, window)
        together = np.divide(*_apart(its.joint, window))
        odd = [c for c in asked.seen if here[c] > max(ODD, TIMES * there[c]) and there[c] < BAD]
        most = max((float(together[c]) for c in odd), default=0.0)
        if most > TIMES:
            told.append((most, window, odd, here, there))
    if not told:
        return
    _, window, odd, here, there = max(told, key=lambda each: each[0])
    first, last = its.samples[window[0]], its.samples[window[-1]]
    names, most = asked.names(odd), odd[int(np.argmax((here / there)[odd]))]
    yield Check(
        "unrelated_torque",
        names,
        f"from {first.t[0]:.3g} to {last.t[-1]:.3g} s {listed(names)} {'are' if len(odd) > 1 else 'is'} not "
        f"what all the rest says of this motion ({asked.name(most)} is off by {100 * here[most]:.0f} % of "
        f"its size, elsewhere by {100 * there[most]:.0f} % at most): for that time a load, a contact, a "
        "hand, a signal that is not as it is told (its zero, its sign), or something that the model lacks "
        "and that this part of the motion shows alone (a spring, a gear that yields)",
        "look at its plot, and leave the stretch out with from: and to:; ident diagnose asks for contacts",
        recording=first.label,
    )


def _apart(left: np.ndarray, window: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """(C,) of (K, C): the mean within a window, the most outside."""
    its = np.isin(np.arange(len(left)), window)
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.mean(left[its] ** 2, axis=0)), np.max(left[~its], axis=0)


def _left(sums: Sequence[Normal], how: Assignment, size: np.ndarray, chi: np.ndarray) -> np.ndarray:
    """(K, C) rms of what is left of torques in each stretch, as shares of their sizes (C,)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        own = [np.sqrt(n.right(how)[0] / n.rows) for n in sums]
    return np.array([n.errors(chi, how) * its / size for n, its in zip(sums, own)])
