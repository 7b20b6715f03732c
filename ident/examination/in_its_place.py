"""What may be there in the place of the hypothesis that explains most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.equations.prepared import Prepared
from ident.examination.check import Check, listed
from ident.examination.fits.hypothesis import CLEARLY, Asked, Hypothesis, not_recorded
from ident.examination.fits.stretches import RARE, Explained, all_rows, same, steadily
from ident.examination.rivals.rivals import Rival, alike, rivals
from ident.examination.robot.geometry import tables_instead
from ident.examination.torques.magnitudes import UNSIGNED, one_sided


def in_its_place(
    prepared: Prepared, asked: Asked, best: Hypothesis, told: list[Hypothesis]
) -> list[Hypothesis]:
    """Of the hypotheses `told`, of everyday faults and of tables of the robot, those that these recordings do
    not reject beside the best one."""
    return [*_alike(asked, best, told), *_tables(prepared, asked, best), *_magnitudes(asked, best)]


def _alike(asked: Asked, best: Hypothesis, told: list[Hypothesis]) -> list[Hypothesis]:
    """Hypotheses, and everyday faults that were no hypothesis of their own, that stretch by stretch are not
    rejected beside the best one; of a table that is read otherwise, whose fits are others, those that explain
    about as much. (Of a TX40 whose third position held the second one's in one recording, it
    was told to do so in all.)"""
    if not best.words or best.own or not np.isfinite(best.gain):
        return []
    tables = [h for h in told if h.check.check == "joint_axis" and h.words]
    of_robot = [h for h in told if asked.of_robot(h) and h.words]
    either = of_robot if best in tables else tables
    robots = [h for h in either if h is not best and h.gain > best.gain - CLEARLY]
    if asked.of_robot(best):
        signals = [h for h in told if not asked.of_robot(h) and h.words] if best in tables else []
        return robots + [h for h in signals if h.gain > best.gain - CLEARLY]
    whole = all_rows(asked.quick)

    def explained(h: Hypothesis) -> Explained:
        return Explained.less(all_rows(h.quick or asked.quick), h.how, whole)

    its = explained(best)
    others = [h for h in told if h.words not in ("", best.words) and not asked.of_robot(h)]
    near = robots + [h for h in others if not steadily(explained(h), its, RARE)]

    def once_more(r: Rival) -> bool:  # itself, or the same by a number a little off
        of_it = r.joint is not None and f"q{asked.joints[r.joint]}" in best.check.signals
        return (of_it and r.check == best.check.check) or same(r.explained, its, 1e-6)

    pool = (r for r in rivals(asked, whole, asked.how) if not once_more(r))
    also = alike(pool, Explained.by(whole, asked.how), its)
    ahead = {r.words for r in also if r.explained.fit.gain_over(its.fit) > 0}
    return near + [replace(h, ahead=h.words in ahead) for h in _silent(asked, best, [r.words for r in also])]


def _tables(prepared: Prepared, asked: Asked, best: Hypothesis) -> list[Hypothesis]:
    """Tables of the robot that are not rejected beside torques taken otherwise."""
    if best.own or not np.isfinite(best.gain) or asked.of_robot(best) or not best.check.signals:
        return []
    return _silent(asked, best, tables_instead(prepared, asked, best))


def _magnitudes(asked: Asked, best: Hypothesis) -> list[Hypothesis]:
    """Torques that friction alone tells to be turned, and that have one sign while their joints go both ways.
    (A KR 300's fourth, which is mostly friction, without its sign was told to have the other one.)"""
    if not best.own and np.isfinite(best.gain):
        return []
    its, quick = best.check, asked.quick
    dq, joints = np.concatenate([s.dq for s in quick.samples]), quick.columns.joint_of
    both = (dq.min(axis=0) < 0) & (dq.max(axis=0) > 0)
    blamed = [c for c in asked.seen if asked.name(c) in its.signals and both[joints[c]]]
    blamed = [c for c in blamed if one_sided(quick.samples, asked.how.order[c])]
    words = [f"{asked.name(c)} {UNSIGNED}" for c in blamed if its.check == "torque_sign"]
    return _silent(asked, best, words)


def _silent(asked: Asked, best: Hypothesis, words: Sequence[str]) -> list[Hypothesis]:
    """What may be there in the place of the best one, with no line that undoes it."""
    return [Hypothesis(0.0, asked.how, replace(best.check, remedy=""), words=its) for its in words]


def unrecorded(asked: Asked, best: Hypothesis, near: Sequence[Hypothesis]) -> Check | None:
    """Positions that are one number in all recordings, as none is that was recorded, or else the best one and
    what is near it; no line is right for both. (Of a Barrett without its first one its second torque was told
    to have the other sign, and was turned.)"""
    every = np.concatenate([s.q for s in asked.quick.samples])
    still = tuple(f"q{asked.joints[j]}" for j in np.flatnonzero(np.ptp(every, axis=0) == 0))
    if not still or best.check.check == "dead_channel":
        return None
    words = f"{listed(still)} {'is' if len(still) == 1 else 'are'} not recorded, though the joint moves"
    either = best.beside([*near, *_silent(asked, best, [words])]).check
    if not either.signals:  # of so many none is told
        return either
    message = f"{words}, or {either.message.replace(f', or {words}', '')}"
    return replace(not_recorded(still), message=message, open=True)
