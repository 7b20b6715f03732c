"""Faults that a quick fit shows, one after the other.

Of the hypotheses the one that explains most is taken, applied, and the rest are asked again: a torque with
the other sign is not a tilted base as well."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from ident.equations.prepared import Prepared
from ident.examination.believable import believable, unforeseen
from ident.examination.check import Check
from ident.examination.fits.hypothesis import Asked, Hypothesis, bad, not_recorded
from ident.examination.in_its_place import in_its_place, unrecorded
from ident.examination.one_recording.another_signal import another_signal

FAULTS = 4  # at most


@dataclass(frozen=True, slots=True)
class InTurn:
    """What was found, and what is asked with it undone; what that gained; whether nothing can be asked
    further, as it is of the robot, or of too many causes; whether at first anything was odd; and what one
    recording alone shows, beside which nothing else is told."""

    asked: Asked
    found: tuple[Check, ...] = ()
    gained: float = 0.0
    ended: bool = False
    odd: bool = False
    alone: tuple[Check, ...] | None = None


def in_turn(prepared: Prepared, asked: Asked) -> InTurn:
    """Up to a refusal."""
    its, best, near = InTurn(asked), None, list[Hypothesis]()
    doubted = _doubted(prepared)
    for _ in range(FAULTS):
        told = [_moving(its.asked, h) for h in believable(prepared, its.asked)]
        told = [h for h in told if not (doubted and h.check.robot_file)]
        if best is not None and near:  # asked again with the last one undone: no other name of it
            again = {(h.check.check, h.check.signals) for h in told}
            near = [h for h in near if (h.check.check, h.check.signals) not in again]
            its = replace(its, found=(*its.found[:-1], best.beside(near).check))
        if its.found and not its.found[-1].signals:  # of so many causes none was told
            return replace(its, ended=True)
        if not its.found:
            odd = bool(told) or bad(asked.fit) or unforeseen(asked.fit)
            its = replace(its, odd=odd)
            if moved := list(_of_one(prepared, asked, told, odd)):
                return replace(its, alone=_but_leaps(prepared, moved))
        best = max(told, key=lambda h: h.gain, default=None)
        if best is None:
            return its
        here = its.asked
        its = replace(its, found=(*its.found, best.check), gained=its.gained + best.gain)
        ends = here.of_robot(best) or best.check.check in ("unrelated_torque", "dead_channel")
        if ends or best.check.outcome == "refused":  # nothing here that later questions could stand on
            return replace(its, ended=True)
        near = in_its_place(prepared, here, best, told)
        if lost := unrecorded(here, best, near):
            return replace(its, found=(*its.found[:-1], lost), ended=True)
        its = replace(its, asked=here.after(best))
    return its


def _doubted(prepared: Prepared) -> bool:
    """Whether a table shows that a position may be another signal: then no table of the robot is wrong by it.
    (Of a UR10e under a header that had lost its first name two rows of the robot file were told to be
    exchanged, of an AIRBOT whose log counts its joints from 0 that alpha and d belong a row lower.)"""
    checks = [c for s in prepared.streams for c in s.checks]
    odd = [c for c in checks if c.check == "clock_rate"]
    from_0 = any(c.check == "joint_numbers" for c in checks)
    return from_0 or any(name[0] == "q" for c in odd for name in c.signals)


def _of_one(prepared: Prepared, asked: Asked, told: list[Hypothesis], odd: bool) -> Iterator[Check]:
    """What one recording alone shows; not the clock of one whose stamps are uneven, which is told."""
    uneven = {s.label for s in prepared.streams for c in s.checks if c.check == "time_stamps" and c.remedy}
    for check in another_signal(asked, told, positions=odd):
        if check.check != "clock_rate" or check.recording not in uneven:
            yield check


def _but_leaps(prepared: Prepared, checks: list[Check]) -> tuple[Check, ...]:
    """Without a torque that is unlike all its motion asks for, where one was told to leap: that tells by
    what."""
    leapt = any(c.check == "torque_step" for s in prepared.streams for c in s.checks)
    return tuple(c for c in checks if c.check != "unrelated_torque" or not leapt)


def _moving(asked: Asked, h: Hypothesis) -> Hypothesis:
    """Of a position that stands still in all recordings any other motion is one that was not recorded. (Of an
    LWR4+ whose fourth position did it was told as exchanged with the seventh.)"""
    still = asked.still(h.check.signals) if h.quick is not None else ()
    if not still:
        return h
    check = not_recorded(still)
    return replace(h, check=check, words=check.message)
