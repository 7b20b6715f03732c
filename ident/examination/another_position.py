"""A position that is another signal in one of the recordings: turned, in degrees, from another zero.

All other questions move a position alike in all recordings. Where one recording alone is odd, such an answer
explains a part of it by chance: of an LWR4+ whose second joint was turned in the run that is fitted, "the
positions of joints 2 and 5 look swapped" was told. So each position of each recording is moved alone, all
recordings fitted together, and what explains steadily more than every answer for all of them is told.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.examination.bodies import standard
from ident.examination.check import Check
from ident.examination.hypothesis import EXPLAINED, SWAPPED, Asked, Hypothesis, falls
from ident.examination.quick import Assignment, Quick, Sample
from ident.examination.recordings_apart import OFFSETS, OWN, ROWS
from ident.examination.stretches import RARE, Explained, all_rows, steadily
from modelgen.geometry.kinematics import Geometry

SAME = 1.1  # times an error that is as it was


@dataclass(frozen=True, slots=True)
class Moved:
    """One position of one recording, moved: what is then explained."""

    recording: str
    joint: int
    check: str
    words: str
    change: Mapping[str, float]
    explained: Explained

    def remedy(self, asked: Asked) -> str:
        """The study's own line, but for a zero, which is known here to some degrees only."""
        name = f"q{asked.joints[self.joint]}"
        if "offset" in self.change:
            return f"{OWN} with {{{name}: {{offset: {self.change['offset']:.3g}}}}}"
        return f"recordings: [{{name: {json.dumps(self.recording)}, {asked.line({name: self.change})}}}]"


def another_position(asked: Asked, told: Sequence[Hypothesis]) -> Iterator[Check]:
    """The position of one recording that explains steadily more than each of the hypotheses told of all."""
    whole = _thinned(asked.quick)
    if len(whole.samples) < 2:
        return
    before = Explained.by(whole, asked.how)
    best = max(_moved(asked, whole), key=lambda its: its.explained.fit.gain_over(before.fit), default=None)
    if best is None or not _explains(best, before):
        return
    others = [before, *(Explained.by(_thinned(h.quick or asked.quick), h.how) for h in told)]
    others += _carried(whole, best, asked.how) if best.check == "position_zero" else []
    if not all(steadily(its, best.explained, RARE) for its in others):
        return
    near = [its for its in _mirrors(asked, whole, best) if not steadily(its.explained, best.explained, RARE)]
    said = ", or ".join([best.words, *(f"{its.words} in {its.recording}" for its in near)])
    fallen = falls(before.fit, best.explained.fit)
    which = ", these recordings do not tell which" if near else ""
    yield Check(
        best.check,
        (f"q{asked.joints[best.joint]}",),
        f"in this recording {said}{which}: so taken, {fallen} over all recordings",
        " or ".join(dict.fromkeys(its.remedy(asked) for its in (best, *near))),
        recording=best.recording,
    )


def _thinned(quick: Quick) -> Quick:
    """All rows as one, few enough to try a hundred motions."""
    whole = all_rows(quick)
    return whole.of([s.rows(slice(None, None, max(1, len(s.t) // ROWS))) for s in whole.samples])


def _explains(its: Moved, before: Explained) -> bool:
    """Whether as much is explained as by other positions, and the torques that it explains better are."""
    seen = np.isfinite(before.fit.error) & np.isfinite(its.explained.fit.error)
    was, error = before.fit.error[seen], its.explained.fit.error[seen]
    better = error < was / SAME
    gained = its.explained.fit.gain_over(before.fit)
    return bool(gained > SWAPPED and better.any() and (error[better] <= EXPLAINED).all())


def _carried(whole: Quick, its: Moved, how: Assignment) -> Iterator[Explained]:
    """What a body on one of the links explains in its recording: nearly what another zero does."""
    columns, table = whole.columns, Geometry.of(whole.columns.model.geometry)
    if columns.need.model == "D":
        return
    of = {}
    for s in whole.samples:
        bodies = standard(table, s.q, s.dq, s.ddq, free=False)[0] if s.label == its.recording else None
        of[s.label] = None if bodies is None else bodies[columns.joint_of]
    for link in range(len(table.rows)):
        own = slice(10 * link, 10 * link + 10)
        samples = []
        for s in whole.samples:
            bodies = of[s.label]
            more = np.zeros((*s.W.shape[:2], 10)) if bodies is None else bodies[:, :, own]
            samples.append(replace(s, W=np.concatenate([s.W, more], axis=2)))
        yield Explained.by(whole.of(samples), how)


def _moved(asked: Asked, whole: Quick) -> Iterator[Moved]:
    for k in range(len(whole.samples)):
        for joint in range(len(asked.joints)):
            yield from _of(asked, whole, k, joint)


def _mirrors(asked: Asked, whole: Quick, best: Moved) -> Iterator[Moved]:
    """The same of the joint in another recording, where two are all that there is."""
    for k, s in enumerate(whole.samples):
        if s.label != best.recording:
            its = [m for m in _of(asked, whole, k, best.joint) if m.check == best.check]
            yield from sorted(its, key=lambda m: -m.explained.fit.gain_over(best.explained.fit))[:1]


def _of(asked: Asked, whole: Quick, k: int, joint: int) -> Iterator[Moved]:
    """One position of one recording, moved in all ways that are ordinary."""
    name, columns, sample = f"q{asked.joints[joint]}", whole.columns, whole.samples[k]
    its = np.arange(len(asked.joints)) == joint

    def taken(check: str, words: str, change: Mapping[str, float], move: Callable[[Sample], Sample]) -> Moved:
        samples = list(whole.samples)
        samples[k] = move(sample)
        explained = Explained.by(whole.of(samples), asked.how)
        return Moved(sample.label, joint, check, words, change, explained)

    def times(factor: float) -> Callable[[Sample], Sample]:
        return lambda s: s.moved(columns, factor=np.where(its, factor, 1.0))

    def plus(offset: float) -> Callable[[Sample], Sample]:
        return lambda s: s.moved(columns, offset=np.where(its, offset, 0.0))

    yield taken("position_sign", f"{name} has the other sign", {"sign": -1}, times(-1.0))
    if asked.joints[joint] in columns.model.prismatic:
        return
    words = f"{name} is in degrees"
    yield taken("angle_unit", words, {"scale": np.pi / 180}, times(np.pi / 180))
    for offset in [x for size in OFFSETS for x in (size, -size)]:
        words = f"{name} starts from another zero, about {-offset:.2g} rad off"
        yield taken("position_zero", words, {"offset": offset}, plus(offset))
