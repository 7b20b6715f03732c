"""Every check of a study, in three stages, worst first.

    open_recordings   each table: time, lost samples, units, dead and resting channels, logged velocities
    examine_fit       a quick fit against physics: signs, scales, places of torques, gravity, the table's axes
    fit               what only its result shows: parameters not seen or beyond what robots are

A quick fit is asked for faults one after the other (in_turn.py); then what they leave is asked, from what
says most to what says least, until something answers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ident.equations.prepared import Prepared, prepare_study
from ident.errors import RecordingError
from ident.examination.asking import asked_of
from ident.examination.believable import believable, unforeseen
from ident.examination.check import Check, listed, refuse, turned_sign, worst_first
from ident.examination.fits.hypothesis import Asked, bad
from ident.examination.fits.quick import Quick, gain_of
from ident.examination.fits.stretches import all_rows
from ident.examination.fits.unexplained import (
    apart_by_one_fit,
    badly_explained,
    contradicting,
    unexplained,
    unpredicted,
)
from ident.examination.in_its_place import in_its_place
from ident.examination.in_turn import InTurn, in_turn
from ident.examination.one_recording.another_signal import another_signal, more_in_one
from ident.examination.rivals.carried import CARRIED, ambiguous, carried_faults
from ident.examination.rivals.for_a_time import for_a_time
from ident.examination.rivals.other_zeros import other_zeros
from ident.examination.rivals.recordings_apart import (
    foretold_badly,
    halves_apart,
    recordings_apart,
    recordings_unlike,
)
from ident.examination.rivals.stopped_meanwhile import stopped_meanwhile
from ident.examination.rivals.wandering import wandering
from ident.examination.robot.geometry import unseen_base
from ident.examination.robot.left_out import asked_for
from ident.examination.robot.lengths import lengths
from ident.examination.robot.tilted import tilted
from ident.examination.tables.limits import beyond_limits, reads_currents
from ident.examination.tables.same_samples import same_samples
from ident.examination.tables.smoother_here import smoother_here
from ident.examination.torques.currents import motor_signs
from ident.examination.torques.frictionless import frictionless
from ident.examination.torques.weightless import unfelt
from ident.examination.torques.within import changed_within
from ident.examination.undone import mended_study

ALIKE = 2  # causes beside the one that all recordings tell: of more none is told


def examine_tables(prepared: Prepared) -> tuple[Check, ...]:
    """What was found in the recordings when they were opened, and of them against the robot's limits."""
    found = [check for stream in prepared.streams for check in stream.checks]
    judged = prepared.study.judged_again
    twice = [Check("same_rows", (), said, recording=label) for label, said in judged]
    copied = same_samples(prepared.streams)
    smoothed = smoother_here(prepared.streams, reads_currents(prepared))
    return worst_first([*twice, *copied, *found, *smoothed, *beyond_limits(prepared)])


def examine_fit(prepared: Prepared) -> tuple[Check, ...]:
    """What a quick fit shows of signs, scales, places, gravity and axes, with the terms that the study leaves
    out: a torque that misses one looks scaled, or turned. (Of a KR 300 without its viscous friction two were
    told as turned.) Raises RecordingError where no number would mean anything (positions in degrees)."""
    study = prepared.study
    whole_model = not study.effects  # which may stand in the place of what is left out
    if study.without and whole_model:
        prepared = prepared.again(study.with_(without=()))
    asked = asked_of(prepared)
    if asked is None:
        return ()
    dead = {(s.label, c.signals) for s in prepared.streams for c in s.checks if c.check == "dead_channel"}
    lost = {(label, signals) for label, signals in dead if signals[0][0] == "q"}
    stopped = tuple(c for c in stopped_meanwhile(asked) if (c.recording, c.signals) not in lost)
    if lost or stopped:  # what else is odd is its shadow
        return stopped
    halfway = list(changed_within(asked))
    its = in_turn(prepared, asked)
    if its.alone is not None:
        return its.alone + _behind(prepared, its.alone)
    if its.found and its.found[-1].outcome == "refused":
        stream = next(s for s in prepared.streams if s.role == "identify")
        refuse(stream.file, [*examine_tables(prepared), *its.found])
    turned = halfway[-1][1].fit(asked.how).gain_over(asked.fit) if halfway else -np.inf
    if halfway and (not its.found or turned > its.gained):  # what else is odd is its shadow, or it is theirs
        return tuple(check for check, _ in halfway)
    if its.ended:
        return its.found
    found = [*its.found, *motor_signs(its.asked)]
    beside = _beside(prepared, its, found)
    beside += asked_for(study, its.asked) if whole_model else []
    if not found and not beside and len(prepared.columns.need.joints) > 1 and _quiet(prepared):
        beside += unseen_base(prepared, its.asked)
    return (*_joined(found, its.asked.maps), *beside)


def _behind(prepared: Prepared, alone: tuple[Check, ...]) -> tuple[Check, ...]:
    """What the recordings show with that undone which one of them shows alone, and which hid it; not of the
    same signals once more. (Of an LWR4+ with one torque of a run turned and another one times three the
    second was not told, of an AIRBOT that it is one or the other.)"""
    mended = mended_study(prepared.study, alone)
    if mended is None:
        return ()
    try:
        found = examine_fit(prepare_study(mended))
    except RecordingError:
        return ()
    told = {(c.recording, name) for c in alone for name in c.signals}
    return tuple(c for c in found if c.signals and told.isdisjoint((c.recording, x) for x in c.signals))


Question = tuple[bool, Callable[[], Iterable[Check]]]  # whether it is asked, and what answers it


def _first(*questions: Question) -> list[Check]:
    """The answer of the first of the questions that has one."""
    for wanted, ask in questions:
        if wanted and (answer := list(ask())):
            return answer
    return []


def _beside(prepared: Prepared, its: InTurn, found: Sequence[Check]) -> list[Check]:
    """What is told of all that the faults found leave, by the first question that has an answer. `clean`: no
    table shows that something is wrong, nor was anything found."""
    asked = its.asked
    quiet = _quiet(prepared)
    clean = quiet and not found
    apart = list(recordings_apart(asked.quick, asked.how)) if quiet and not its.found else []
    alone = list(another_signal(asked, ())) if apart and not its.odd else []
    alone = alone or list(recordings_unlike(asked, apart))
    beside = alone or _first((clean, lambda: frictionless(asked)), (quiet, lambda: _unexplained(asked)))
    badly = not found and _judged_badly(prepared, asked)
    if alone and badly:
        beside = _carried(asked) or alone
    beside = beside or _first(
        (badly, lambda: _carried(asked)),
        (badly, lambda: _by_all(prepared, asked)),
        (clean, lambda: (h.check for h in lengths(prepared, asked))),
    )
    if not beside:
        meanwhile = list(for_a_time(asked)) if clean else []
        beside = _first(
            (True, lambda: (c for c in meanwhile if len(c.signals) > 1)),  # which no torque's zero makes so
            (quiet and not meanwhile, lambda: unpredicted(asked)),
            (quiet, lambda: tilted(prepared, asked)),  # before a torque's weights, which it changes
            (quiet, lambda: wandering(asked)),
            (clean, lambda: other_zeros(asked)),
            (True, lambda: meanwhile),
            (True, lambda: foretold_badly(asked, apart)),
            (True, lambda: contradicting(asked)),
            (clean, lambda: halves_apart(asked)),
            (clean, lambda: badly_explained(asked)),
            (clean and not bad(asked.fit), lambda: unfelt(asked)),
        )
    return beside


def _unexplained(asked: Asked) -> list[Check]:
    """What nothing explains; of a recording that is the odd one the signal that is another one there beside
    all others but one, which is odd by something else. (Of an AIRBOT with all torques of a run turned and
    half a kilogram in another one loads of 1.3 and 1.8 kg were told in the others.)"""
    told, found = list(unexplained(asked)), dict[tuple[str, tuple[str, ...]], Check]()
    odd = {check.recording for check in told if check.check == "wrong_robot"} - {""}
    for another in asked.quick.samples if odd else ():
        kept = [s for s in asked.quick.samples if s is not another]
        if another.label in odd or not any(s.role == "identify" for s in kept):
            continue
        rest = asked.quick.of(kept)
        its, over = replace(asked, quick=rest, fit=rest.fit(asked.how)), listed(s.label for s in kept)
        found |= {(c.check, c.signals): c for c in another_signal(its, (), over=over) if c.recording in odd}
    return list(found.values()) if len(found) == 1 else told


def _judged_badly(prepared: Prepared, asked: Asked) -> bool:
    """Whether the recordings that judge are, and no table shows that a position is wrong."""
    held = asked.fit.validate
    return held is not None and not _elsewhere(prepared) and gain_of(held, asked.fit.error) > CARRIED


def _quiet(prepared: Prepared) -> bool:
    """Whether no table shows that something is wrong. (Of an AIRBOT whose torques are 1.3 times too large
    from an instant on, at which one leaps, it was told, too, that nothing shows how its base is mounted.)"""
    return not any(c.hint for stream in prepared.streams for c in stream.checks)


def _elsewhere(prepared: Prepared) -> bool:
    """Whether a table shows that a position is wrong. (Of a TX40 whose motors were recorded in the place of
    its joints that was told, and that the base may hang upside down.)"""
    return any(c.hint and c.signals[0][0] == "q" for s in prepared.streams for c in s.checks)


def _carried(asked: Asked) -> list[Check]:
    """Faults without which the recordings that judge would be predicted."""
    held, scaled = asked.fit.validate, carried_faults(asked)
    return [] if held is None or not scaled else [ambiguous(held, scaled)]


def _by_all(prepared: Prepared, asked: Asked) -> list[Check]:
    """What all recordings together tell, where those that are fitted do not, and foretell the others badly.
    (Of three to five seconds of a rokae a factor, or a base on a wall, was another robot, or nothing.) It has
    to make one robot of the recordings."""
    whole = all_rows(asked.quick)
    both = replace(asked, quick=whole, fit=whole.fit(asked.how))
    told = believable(prepared, both)
    best = max(told, key=lambda h: h.gain, default=None)
    if best is None or best.check.outcome == "refused":
        return []
    made = best.quick or whole
    of_robot = both.of_robot(best)
    if not of_robot and apart_by_one_fit(made, best.how).any():
        return []
    of_all = not of_robot and (best.quick is not None or not best.check.signals)  # or nothing tells which
    if of_all and unforeseen(_in_roles(made, asked.quick).fit(best.how)):
        return []
    near = in_its_place(prepared, both, best, told)
    known = both.of_robot(best) or best.own or not np.isfinite(best.gain)  # by friction, not by what is left
    if len(near) > ALIKE or (not known and more_in_one(both, best)):
        return []
    check = best.beside(near).check
    return [replace(check, message=f"{check.message}, over all recordings")]


def _in_roles(moved: Quick, quick: Quick) -> Quick:
    """All rows with another motion, as what is fitted and what judges again."""
    role = {s.label: s.role for s in quick.samples}
    return moved.of([replace(s, role=role[s.label]) for s in moved.samples])


def sentences(check: str, texts: Iterable[str]) -> tuple[Check, ...]:
    """Warnings of a fit's result as checks."""
    return tuple(Check(check, (), text) for text in texts)


def _joined(found: list[Check], maps: Mapping[str, Any]) -> list[Check]:
    """Several single signs as one check, which one line undoes; not those that may be another's."""
    signs = [c for c in found if c.check == "torque_sign" and len(c.signals) == 1 and "#" not in c.remedy]
    if len(signs) < 2:
        return found
    names = tuple(c.signals[0] for c in signs)
    message = f"{', '.join(names)} have the other sign: " + "; ".join(
        c.message.split(": ", 1)[1] for c in signs
    )
    return [turned_sign(names, message, maps), *(c for c in found if c not in signs)]
