"""A clock that runs at another rate, or in another unit: of one recording beside the others', or of all.

Rates and accelerations go with the stamps, positions and torques do not: that a log of 5 kHz in ms is one of
5 Hz in s only the others say. (Of a TX40's judged run in ms another robot or another load was told.) Of all
recordings what bodies ask for says it: of their inertia and their weight one goes with the clock. (Of a
Franka whose clock ran at half of its rate something of three joints was told, not foretold: 16 % for 2 %.)
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ident.equations.columns import Columns
from ident.examination.check import FEW, Check
from ident.examination.fits.hypothesis import CLEARLY, Asked, Hypothesis, falls
from ident.examination.fits.quick import Assignment, Fit, Normal, Quick, added, solve
from ident.examination.fits.samples import Sample, at_rest
from ident.examination.fits.stretches import ODD, RARE, Explained, agreed, all_rows, confirmed, steadily
from ident.examination.one_recording.changed import Changed
from ident.examination.positions.units import times_too
from ident.examination.rivals.recordings_apart import thinned
from ident.examination.rivals.rivals import Rival, alike, rivals
from ident.examination.tables.clock import UNITS

RATES = np.geomspace(1 / 40, 40, 21)
FINER, TIMES = 7, 3  # of them between the neighbours of the best one, so often
WIDE, STEPS = 2.0, 10  # about the best one: the range in which others are allowed, and steps to its ends


def clock_of_all(asked: Asked) -> Iterator[Hypothesis]:
    """The clock of all recordings, where no logged velocity agrees with it. Bodies show gravity times time^2
    by length and no more. (Of a UR10e with the table of a KR 300 t was 3 times too small.)"""
    if asked.velocities:
        return
    few = all_rows(asked.quick)
    few = few.of([thinned(s) for s in few.samples])
    each = [Timed.of(few.columns, s) for s in few.samples]
    rate = _best_rate(lambda rate: solve(added([its.at(rate) for its in each]), None, asked.how))
    if rate is None:
        return
    taken = _timed(asked.quick, rate)
    if not confirmed(asked.quick, asked.how, taken, asked.how, len(RATES)) or _more_by_weights(asked, taken):
        return
    ends = _allowed(few, asked.how, rate)
    least, most = ends if rate > 1 else sorted(1 / x for x in ends)
    clock = f"t is {times_too(1 / rate)} (its clock, {least:.2g} to {most:.2g} by these torques)"
    words = f"{clock}, or the robot file's lengths are {times_too(rate**2)}, as another robot's may be"

    def told(other: Fit) -> Check:
        line = asked.line({"t": {"scale": float(f"{rate:.3g}")}})
        message = f"in all recordings {words}: so taken, {falls(asked.fit, other)}"
        remedy = f"check the robot file, or write {line}, or the rate that is known"
        return Check("clock_rate", ("t",), message, remedy, open=True)

    for its in asked.along(taken, told, words, least=0.0):
        if its.gain > CLEARLY or len(_beside(asked, taken)) <= FEW:
            yield its


def _beside(asked: Asked, taken: Quick) -> list[Rival]:
    """What explains as much: beside much of it the little that a clock explains is a rest of anything."""
    whole = all_rows(asked.quick)
    plain, its = Explained.by(whole, asked.how), Explained.by(all_rows(taken), asked.how)
    return alike(rivals(asked, whole, asked.how), plain, its)


def _allowed(few: Quick, how: Assignment, rate: float) -> tuple[float, float]:
    """The least and the largest rate that stretch by stretch are not rejected beside the best one."""
    best = Explained.by(_timed(few, rate), how)
    rates = rate * np.geomspace(1 / WIDE, WIDE, 2 * STEPS + 1)
    rejected = [agreed(Explained.by(_timed(few, r), how), best, ODD / 2) for r in rates]
    kept = np.flatnonzero(~np.array(rejected))
    ends = np.clip([kept[0] - 1, kept[-1] + 1], 0, 2 * STEPS)
    return float(rates[ends[0]]), float(rates[ends[1]])


def _more_by_weights(asked: Asked, taken: Quick) -> bool:
    """Whether bodies whose weight has nothing to do with their inertia, of which another clock is one kind,
    explain steadily more than that clock: then it is another thing. (Of a Franka's table with two rows
    exchanged three signs and a clock of a third were told.)"""
    own = [s.beside(at_rest(asked.quick.columns, s.payload, s.q)) for s in asked.quick.samples]
    weights = Explained.by(all_rows(asked.quick.of(own)), asked.how)
    return steadily(Explained.by(all_rows(taken), asked.how), weights, RARE)


def _timed(quick: Quick, rate: float) -> Quick:
    return quick.of([s.timed(quick.columns, rate) for s in quick.samples])


@dataclass(frozen=True, slots=True)
class Timed:
    """A recording's sums along any clock: rates are times 1/rate, accelerations times its square, so that W
    is a polynomial of the second degree in 1/rate, and W'W of the fourth. (Effects of a study may be no such
    polynomial; where the best rate is looked for that is near enough, what is told of it is not made here.)
    G (5, C, b, b), v (3, C, C, b) of each power."""

    G: np.ndarray
    v: np.ndarray
    plain: Normal

    @classmethod
    def of(cls, columns: Columns, s: Sample) -> Timed:
        back, slow = s.timed(columns, -1.0).W, s.timed(columns, 2.0).W
        odd, even = (s.W - back) / 2, (s.W + back) / 2
        square = (even - (slow - odd / 2)) / 0.75
        sums = Normal.of(replace(s, W=np.concatenate([even - square, odd, square], axis=2)))
        C, _, b = s.W.shape
        by_power, G = sums.G.reshape(C, 3, b, 3, b), np.zeros((5, C, b, b))
        for i, j in product(range(3), repeat=2):
            G[i + j] += by_power[:, i, :, j]
        return cls(G, np.moveaxis(sums.v.reshape(C, C, 3, b), 2, 0), sums)

    def at(self, rate: float) -> Normal:
        power = float(rate) ** -np.arange(5.0)
        return replace(self.plain, G=np.tensordot(power, self.G, 1), v=np.tensordot(power[:3], self.v, 1))


def _best_rate(taken: Callable[[float], Fit]) -> float | None:
    """The number times which stamps explain most; None at the ends, as if there were no motion or nothing but
    gravity."""
    none, rates = taken(1.0), RATES
    for turn in range(TIMES):
        tried = [taken(float(rate)).gain_over(none) for rate in rates]
        best = int(np.argmax(tried))
        if turn == 0 and best in (0, len(RATES) - 1):
            return None
        rate = float(rates[best])
        rates = np.geomspace(rates[max(best - 1, 0)], rates[min(best + 1, len(rates) - 1)], FINER)
    return rate


def clocks(asked: Asked, whole: Quick) -> Iterator[Changed]:
    """Each recording's stamps in each unit, and times the number with which all are explained best; none
    where logged velocities agree with it."""
    if not asked.velocities:
        for sample in whole.samples:
            yield from _clock(asked.how, whole, sample)


def _clock(how: Assignment, whole: Quick, sample: Sample) -> Iterator[Changed]:
    def taken(factor: float) -> Explained:
        timed = sample.timed(whole.columns, factor)
        return Explained.by(whole.of([timed if s is sample else s for s in whole.samples]), how)

    name = json.dumps(sample.label)
    for unit, scale, _ in UNITS:
        line = f"recordings: [{{name: {name}, columns: {{t: {{scale: {scale:g}}}}}}}]"
        words = f"t is in {unit}"
        yield Changed(sample.label, ("t",), "time_unit", words, line, taken(scale))
    its = Timed.of(whole.columns, sample)
    others = [sums for s, sums in zip(whole.samples, whole.each) if s is not sample]
    rate = _best_rate(lambda rate: solve(added([its.at(rate), *others]), None, how))
    if rate is not None:
        words = f"t is {times_too(1 / rate)} (its clock)"
        remedy = f"give it a columns: of its own in the study with {{t: {{scale: {rate:.3g}}}}}"
        yield Changed(sample.label, ("t",), "clock_rate", words, remedy, taken(rate))


def beside_noise(its: Changed, noisy: Iterable[Changed]) -> bool:
    """Whether a clock explains steadily more beside each position of its recording that is better smoothed,
    too: the rates that noise makes are less by a slow clock. (Of an LWR4+'s third position with noise of 0.03
    rad it was told that t may be 17.6 times too small.)"""
    for other in noisy:
        if other.recording == its.recording:
            (smoothed,) = (s for s in other.explained.quick.samples if s.label == its.recording)
            both = _clock(other.explained.how, other.explained.quick, smoothed)
            if not any(steadily(other.explained, so.explained, RARE) for so in both):
                return False
    return True
