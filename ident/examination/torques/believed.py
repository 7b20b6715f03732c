"""Whether a hypothesis about signals explains enough to be told."""

from __future__ import annotations

import numpy as np

from ident.examination.fits.halves import of_either_half
from ident.examination.fits.hypothesis import (
    EXPLAINED,
    NOTHING,
    SAME,
    Asked,
    Hypothesis,
    explains,
    of_several,
)
from ident.examination.fits.quick import Fit, gain_of, gains_of
from ident.examination.fits.stretches import HALF
from ident.examination.fits.unexplained import contradicted, odd_beside
from ident.examination.torques.signs import SURE, evidence

FALLEN, RISEN = 0.7, 1.02  # of the error before, at most: where one position is blamed, and anything else


def believed(asked: Asked, h: Hypothesis) -> bool:
    """Whether the model explains, and predicts, the signals that the hypothesis blames once it is taken; all
    of them where it blames positions, which stand in every torque, and clearly better than before, those
    that it touches, where it is one position alone, by what others say: where something large is missing in
    the model (a cable over two joints, gravity elsewhere), one wrong sign or order may leave less without
    being the cause. (An AIRBOT's first position turned, which its friction says, was not told so.) A
    torque that no other contradicts is known by its friction, whatever else is missing; others have to be
    explained as by themselves. (Of a Franka's third torque without its sign the other sign was told.)"""
    before, taken = asked.fit, asked.after(h)
    if h.how.order != asked.how.order and not _explained_there(asked, h, taken.fit):
        return False
    fit, joints = taken.fit, asked.joints
    motion = any(name[0] in "qt" and name[:3] != "tau" for name in h.check.signals) and not h.own
    blamed = set(joints) if motion else {"".join(filter(str.isdigit, name)) for name in _changed(asked, h)}
    its = [
        c
        for c, j in enumerate(asked.quick.columns.joint_of)
        if joints[j] in blamed and np.isfinite(fit.error[c])
    ]
    if h.quick is None and len(fit.error) == 1 and evidence(taken.quick, fit, h.how).friction[0] > SURE:
        return bool(fit.error[0] < NOTHING)
    if h.quick is None and not h.own and odd_beside(fit.error, taken.alone)[its].any():
        return False
    if not motion and 2 * len(its) <= len(asked.seen) and _a_part(asked, h, taken):
        return False
    moved = {j for j, label in enumerate(joints) if f"q{label}" in h.check.signals}
    if motion and not of_several(asked.quick.columns, before, fit, moved):
        return False
    known = h.own or asked.of_robot(h) or not np.isfinite(h.gain)  # by friction, by size, or by no fit
    if not known and not of_either_half(asked.quick, asked.how, taken.quick, h.how):
        return False
    explained = explains(before.error[its], fit.error[its])
    worst = [0.0 if x.validate is None else float(np.nanmax(x.validate, initial=0.0)) for x in (fit, before)]
    predicted = not min(worst) > 1
    if moved and len(h.check.signals) == 1 and not h.own:  # of one position
        touched = np.abs(gains_of(before.error, fit.error)) > np.log(SAME)  # a wrist's position moves its own
        return explained and predicted and fit.gain_over(before) > -np.log(FALLEN) * touched.sum()
    return explained and predicted and _rms(fit) < RISEN * _rms(before)


def _a_part(asked: Asked, h: Hypothesis, taken: Asked) -> bool:
    """Whether a fit alone speaks for other torques, and these take off less than half of that by which the
    torques contradict each other, and leave some that do, or are asked for less: one that is asked for no
    bodies contradicts none. (Of a dual arm with two sensors turned and two positions exchanged a third sensor
    was told to be turned, and by it a current; of an LWR4+ whose second and third positions have other zeros
    the fifth torque was told to show friction alone. Of a TX40's second torque, 101 times too small, which
    alone makes the third contradict the others, nothing was told.) Not of what is said of most torques."""
    if h.own or asked.of_robot(h) or not np.isfinite(h.gain):
        return False
    apart = gain_of(asked.fit.error, asked.alone)
    left = h.quick is not None or contradicted(taken).any()
    return bool(h.gain < HALF * apart and contradicted(asked).any() and left)


def _changed(asked: Asked, h: Hypothesis) -> tuple[str, ...]:
    """The signals that a hypothesis blames; of one that is told beside too many others to blame any, the
    torques that it takes otherwise. (Of an AIRBOT's second torque times 1.3, or the third's times 0.75, and
    three causes more, nothing was said.)"""
    moved = [c for c in asked.seen if h.how.factor[c] != asked.how.factor[c]]
    return h.check.signals or asked.names(moved)


def _explained_there(asked: Asked, h: Hypothesis, after: Fit) -> bool:
    """Whether torques that judge are predicted in their other places, or hardly worse than before. Of clipped
    ones other rows are left of each, which say nothing of places. (Of an LWR4+ with all torques clipped
    joints 5 and 7 were exchanged.)"""
    moved = [c for c, (k, its) in enumerate(zip(h.how.order, asked.how.order)) if k != its]
    if asked.clipped.intersection(asked.names(moved)):
        return False
    if asked.fit.validate is None or after.validate is None:
        return True
    before = asked.fit.validate[[asked.how.order.index(h.how.order[c]) for c in moved]]
    return bool((after.validate[moved] <= np.fmax(EXPLAINED, SAME * before)).all())


def _rms(fit: Fit) -> float:
    return float(np.sqrt(np.nanmean(fit.error**2)))
