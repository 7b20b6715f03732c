"""A signal that is another one in one of the recordings: a position turned, in degrees, from another zero, a
torque turned.

All other questions change a signal alike in all recordings. Where one recording alone is odd, such an answer
explains a part of it by chance: of an LWR4+ whose second joint was turned in the run that is fitted, "the
positions of joints 2 and 5 look swapped" was told. So each signal of each recording is changed alone, all
recordings fitted together, and what explains steadily more than every answer for all of them is told.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.examination.bodies import standard
from ident.examination.check import Check
from ident.examination.hypothesis import EXPLAINED, SWAPPED, Asked, Hypothesis, falls
from ident.examination.quick import Assignment, Quick, Sample
from ident.examination.recordings_apart import OFFSETS, OWN, thinned
from ident.examination.stretches import RARE, Explained, all_rows, steadily
from modelgen.geometry.kinematics import Geometry

SAME = 1.1  # times an error that is as it was


@dataclass(frozen=True, slots=True)
class Changed:
    """One signal of one recording, changed: what is then explained."""

    recording: str
    signal: str
    check: str
    words: str
    change: Mapping[str, float]
    explained: Explained

    def remedy(self, asked: Asked) -> str:
        """The study's own line, but for a zero, which is known here to some degrees only."""
        if "offset" in self.change:
            return f"{OWN} with {{{self.signal}: {{offset: {self.change['offset']:.3g}}}}}"
        line = asked.line({self.signal: self.change})
        return f"recordings: [{{name: {json.dumps(self.recording)}, {line}}}]"


def another_signal(asked: Asked, told: Sequence[Hypothesis]) -> Iterator[Check]:
    """The signal of one recording that explains steadily more than each of the hypotheses told of all."""
    whole = _few(asked.quick)
    if len(whole.samples) < 2:
        return
    before = Explained.by(whole, asked.how)
    best = max(_changed(asked, whole), key=lambda its: its.explained.fit.gain_over(before.fit), default=None)
    if best is None or not _explains(best, before):
        return
    others = [before, *(Explained.by(_few(h.quick or asked.quick), h.how) for h in told)]
    others += _carried(whole, best, asked.how) if best.check == "position_zero" else []
    if not all(steadily(its, best.explained, RARE) for its in others):
        return
    near = [its for its in _mirrors(asked, whole, best) if not steadily(its.explained, best.explained, RARE)]
    said = ", or ".join([best.words, *(f"{its.words} in {its.recording}" for its in near)])
    fallen = falls(before.fit, best.explained.fit)
    which = ", these recordings do not tell which" if near else ""
    yield Check(
        best.check,
        (best.signal,),
        f"in this recording {said}{which}: so taken, {fallen} over all recordings",
        " or ".join(dict.fromkeys(its.remedy(asked) for its in (best, *near))),
        recording=best.recording,
        explains=best.check != "position_zero",  # that the diagnosis asks for itself, and sizes
    )


def _few(quick: Quick) -> Quick:
    """All rows as one, few enough to try a hundred motions."""
    whole = all_rows(quick)
    return whole.of([thinned(s) for s in whole.samples])


def _explains(its: Changed, before: Explained) -> bool:
    """Whether as much is explained as by other positions, and the torques that it explains better are."""
    seen = np.isfinite(before.fit.error) & np.isfinite(its.explained.fit.error)
    was, error = before.fit.error[seen], its.explained.fit.error[seen]
    better = error < was / SAME
    gained = its.explained.fit.gain_over(before.fit)
    return bool(gained > SWAPPED and better.any() and (error[better] <= EXPLAINED).all())


def _carried(whole: Quick, its: Changed, how: Assignment) -> Iterator[Explained]:
    """What a body on one of the links explains in its recording: nearly what another zero does."""
    columns, table = whole.columns, Geometry.of(whole.columns.model.geometry)
    if columns.need.model == "D":
        return
    (s,) = (s for s in whole.samples if s.label == its.recording)
    bodies = standard(table, s.q, s.dq, s.ddq, free=False)[0][columns.joint_of]
    for link in range(len(table.rows)):
        own = bodies[:, :, 10 * link : 10 * link + 10]
        samples = [x.beside(own if x is s else np.zeros((*x.W.shape[:2], 10))) for x in whole.samples]
        yield Explained.by(whole.of(samples), how)


def _changed(asked: Asked, whole: Quick) -> Iterator[Changed]:
    for k in range(len(whole.samples)):
        yield from _torques(asked, whole, k)
        for joint in range(len(asked.joints)):
            yield from _positions(asked, whole, k, joint)


def _mirrors(asked: Asked, whole: Quick, best: Changed) -> Iterator[Changed]:
    """The same of the signal in another recording, where two are all that there is."""
    for k, s in enumerate(whole.samples):
        if s.label != best.recording:
            if best.signal[0] == "q":
                every = _positions(asked, whole, k, asked.joints.index(best.signal[1:]))
            else:
                every = _torques(asked, whole, k)
            its = [m for m in every if (m.check, m.signal) == (best.check, best.signal)]
            yield from sorted(its, key=lambda m: -m.explained.fit.gain_over(best.explained.fit))[:1]


def _taken(asked: Asked, whole: Quick, k: int, sample: Sample) -> Explained:
    return Explained.by(whole.of([*whole.samples[:k], sample, *whole.samples[k + 1 :]]), asked.how)


def _torques(asked: Asked, whole: Quick, k: int) -> Iterator[Changed]:
    """Each torque of one recording turned."""
    sample = whole.samples[k]
    for c in asked.seen:
        sign = np.where(np.arange(sample.Y.shape[1]) == asked.how.order[c], -1.0, 1.0)
        explained = _taken(asked, whole, k, replace(sample, Y=sample.Y * sign))
        name = asked.name(c)
        words = f"{name} has the other sign"
        yield Changed(sample.label, name, "torque_sign", words, {"sign": -1}, explained)


def _positions(asked: Asked, whole: Quick, k: int, joint: int) -> Iterator[Changed]:
    """One position of one recording, moved in all ways that are ordinary."""
    name, columns, sample = f"q{asked.joints[joint]}", whole.columns, whole.samples[k]
    its = np.arange(len(asked.joints)) == joint

    def changed(check: str, words: str, change: Mapping[str, float], **motion: float) -> Changed:
        factor, offset = (
            np.where(its, motion.get(key, none), none) for key, none in (("factor", 1.0), ("offset", 0.0))
        )
        explained = _taken(asked, whole, k, sample.moved(columns, factor=factor, offset=offset))
        return Changed(sample.label, name, check, f"{name} {words}", change, explained)

    yield changed("position_sign", "has the other sign", {"sign": -1}, factor=-1.0)
    if asked.joints[joint] in columns.model.prismatic:
        return
    yield changed("angle_unit", "is in degrees", {"scale": np.pi / 180}, factor=np.pi / 180)
    for offset in [x for size in OFFSETS for x in (size, -size)]:
        words = f"starts from another zero, about {-offset:.2g} rad off"
        yield changed("position_zero", words, {"offset": offset}, offset=offset)
