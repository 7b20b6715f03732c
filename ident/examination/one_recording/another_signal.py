"""A signal that is another one in one of the recordings, or in all: a position turned, in degrees, from
another zero, a torque turned, exchanged with another, times a number; or gravity, where its base is.

All other questions change a signal alike in all recordings. Where one recording alone is odd, such an answer
explains a part of it by chance: of an LWR4+ whose second joint was turned in the run that is fitted, "the
positions of joints 2 and 5 look swapped" was told. So each signal of each recording is changed alone, all
recordings fitted together, and what explains steadily more than every answer for all of them is told, with
all that these recordings do not tell from it: another signal, the same one of another recording or of all, a
load or other friction there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from ident.examination.check import FEW, Check, listed, nothing_tells
from ident.examination.fits.bodies import AS_OTHERS, ENOUGH, beyond_own, standard
from ident.examination.fits.hypothesis import (
    EXPLAINED,
    SAME,
    Asked,
    Hypothesis,
    bad,
    falls,
    not_recorded,
)
from ident.examination.fits.quick import FLOOR, Quick, gain_of, gains_of
from ident.examination.fits.stretches import HALF, RARE, Explained, all_rows, half_of, steadily
from ident.examination.fits.unexplained import apart_by_one_fit, by_each_recording, odd_beside
from ident.examination.one_recording.another_clock import beside_noise, clocks
from ident.examination.one_recording.changed import Changed, positions_in_all, torques_in_all
from ident.examination.one_recording.changed_in_one import (
    factors_of,
    positions_in_one,
    torques_in_one,
    weightless_in_one,
)
from ident.examination.one_recording.mounted_otherwise import mounted_otherwise
from ident.examination.rivals.recordings_apart import thinned
from ident.examination.rivals.rivals import alike, standing
from ident.examination.rivals.scales import NORMAL, span_of
from ident.examination.torques.signs import evidence
from modelgen.geometry.kinematics import Geometry
from modelgen.geometry.names import ParameterName

NEAR_A_LOAD = ("position_zero", "torque_scale", "gravity_compensated", "base_orientation")
LOAD = "a load is carried that the study does not declare", "declare it with payload:"


def another_signal(
    asked: Asked, told: Sequence[Hypothesis], positions: bool = True, over: str = "all recordings"
) -> Iterator[Check]:
    """The signal of one recording that explains steadily more than each of the hypotheses told of all; or of
    all, where the fitted ones are too poor to tell it and those that judge do. (Of seven seconds of a rokae
    with its third position turned that was told of the recording that judges.)

    Positions cost a motion each; without them it is looked whether a torque is another one, and they are
    asked where it looks so, or where no fit of all recordings explains a torque, or not as fits of each do.
    (Each of a UR10e's, of which one had its fourth position doubled, was explained well enough by itself. Of
    a TX40 one of whose runs had its second joint homed a quarter turn off nothing was said, and 32 % were
    left for 8.) Nothing is where what judges is not foretold at all though one fit explains all as fits of
    each do. (Of six clean seconds of an LWR4+ two torques looked swapped.)"""
    whole = _few(asked.quick)
    if len(whole.samples) < 2:
        return
    before = Explained.by(whole, asked.how)
    judged = asked.fit.validate
    foretold = judged is None or not np.nanmax(judged, initial=0.0) > 1.0
    if not (foretold or bad(before.fit) or apart_by_one_fit(whole, asked.how).any()):
        return

    def gain(its: Changed) -> float:
        return its.explained.fit.gain_over(before.fit)

    def better(tried: Iterable[Changed]) -> list[Changed]:  # of hundreds, each with its own equations, few
        return [its for its in tried if gain(its) > 0]

    torques = chain(
        torques_in_one(asked, whole, before), weightless_in_one(asked, whole), torques_in_all(asked, whole)
    )
    found = better(chain(torques, clocks(asked, whole), mounted_otherwise(asked, whole)))
    apart = _mean(before.fit.error) > AS_OTHERS * _mean(by_each_recording(whole, asked.how))
    if positions or apart or bad(before.fit) or any(_explains(its, before) for its in found):
        moved = better(chain(positions_in_one(asked, whole), positions_in_all(asked, whole)))
        found += [_moving(asked, its) for its in moved]
    noisy = [its for its in found if its.check == "noisy_position"]
    found = [its for its in found if its.signals != ("t",) or beside_noise(its, noisy)]

    owns = [Explained.by(whole.of([s]), asked.how) for s in whole.samples]
    best = _best(asked, before, owns, sorted(found, key=gain, reverse=True))
    if best is None or _contradicted(best):
        return
    if any(h.gain > gain(best) for h in told if asked.of_robot(h)):
        return
    if any(_rubs_on(asked, h, best.explained) for h in told if h.own):
        return
    others = [Explained.by(_few(h.quick or asked.quick), h.how) for h in told if not asked.of_robot(h)]
    if not all(steadily(its, best.explained, RARE) for its in (before, *others)):
        return
    instead = _instead(whole, best, asked)
    if any(steadily(best.explained, its.explained, RARE) for its in instead):
        return
    pool = standing(asked, whole, asked.how, best.explained)
    if pool is None:
        return
    same = alike((its for its in pool if its.zero or not its.recording), before, best.explained)
    whose = [best.recording if its.recording else "" for its in same]  # that of words which say it themselves
    everywhere = [Changed(its, (), "", r.words, "", r.explained) for r, its in zip(same, whose)]
    if any(gain(its) > gain(best) for its, r in zip(everywhere, same) if not r.beside):
        return  # by what is told nowhere else; the others stand beside it
    once = {
        (its.recording, its.check, its.signals): its for its in sorted(found, key=gain) if its is not best
    }
    told_too = [its for its in once.values() if _explains(its, before)]
    told_too = [its for its in told_too if steadily(before, its.explained, RARE)]
    told_too = [its for its in told_too if _of_itself(before, owns, its) and _itself(asked, before, its)]
    told_too = [its for its in told_too if half_of(before, best.explained, its.explained)]
    near = [its for its in (*told_too, *instead) if not steadily(its.explained, best.explained, RARE)]
    first = max(instead, key=gain, default=best)  # of ten numbers, which may have less to say than one
    every = [best, *sorted([*near, *everywhere], key=gain, reverse=True)]
    every.sort(key=lambda its: its is not first or gain(its) <= gain(best))
    said = list({its.words + _where(its, best): its for its in every})
    fallen = f"{falls(before.fit, best.explained.fit)} over {over}"
    where = "in this recording " if best.recording else ""
    which = ", these recordings do not tell which" if said[1:] else ""
    taken = "with another one in its place" if best.check == "dead_channel" else "so taken"
    causes = {its.words for its in every}  # here or in the other recording, which contradict each other
    if len(causes) > 1 + FEW or every[0] is not best:
        yield nothing_tells(said, fallen, best.recording)
        return
    spread = None
    if best.factor is not None:
        low, high = factors_of(asked, whole, best)
        said[0] += span_of(best.factor, low, high)
        spread = (high - low) / (2 * NORMAL * best.factor)
    yield Check(
        best.check,
        best.signals,
        f"{where}{', or '.join(said)}{which}: {taken}, {fallen}",
        " or ".join(dict.fromkeys(its.remedy for its in every if its.remedy)),
        recording=best.recording,
        explains=best.check != "position_zero"  # which is told to some degrees only
        and all(its.recording and its.check for its in every),
        open=len(said) > 1,
        spread=spread,
    )


def more_in_one(asked: Asked, h: Hypothesis) -> bool:
    """Whether a signal of one recording alone explains more than what is told of all. (Of an LWR4+ whose
    fourth position starts from another zero in the run that judges two were told to look swapped.)"""
    whole = _few(asked.quick)
    if len(whole.samples) < 2:
        return False
    before, told = Explained.by(whole, asked.how), Explained.by(_few(h.quick or asked.quick), h.how)
    found = chain(torques_in_one(asked, whole, before), positions_in_one(asked, whole))
    return any(its.recording and its.explained.fit.gain_over(told.fit) > 0 for its in found)


def _rubs_on(asked: Asked, h: Hypothesis, explained: Explained) -> bool:
    """Whether the friction that tells a hypothesis of all recordings says the same beside what is told of
    one. (Of a Franka at 50 Hz with its last torque turned it was told that its second position is noisy in
    one of two runs, and nothing else.)"""
    says = evidence(explained.quick, explained.fit, explained.how)
    joints = [asked.joints[j] for j in asked.quick.columns.joint_of]
    blamed = [c for c in asked.seen if {asked.name(c), f"q{joints[c]}"}.intersection(h.check.signals)]
    return any(says.against(c) for c in blamed)


def _moving(asked: Asked, its: Changed) -> Changed:
    """Of a position that stands still in all recordings, or in this one, any other place is one that was not
    recorded. (Of an LWR4+'s fourth, which did in the fitted run, it was told to be swapped with the last.)"""
    recording = "" if asked.still(its.signals) else its.recording
    still = asked.still(its.signals, recording)
    if not still:
        return its
    check = not_recorded(still, "" if recording else " in all recordings")
    so = check.check, check.message, check.remedy
    return replace(its, recording=recording, signals=still, check=so[0], words=so[1], remedy=so[2])


def _where(its: Changed, best: Changed) -> str:
    if its.recording == best.recording:
        return ""
    return f" in {its.recording}" if its.recording else " in all recordings"


def _best(
    asked: Asked, before: Explained, owns: Sequence[Explained], found: Sequence[Changed]
) -> Changed | None:
    """The first of these, most gain first, that its recording bears by itself, where it explains enough, its
    own torque among it, and what gains more does not reject it, nor is borne and explains half as much of the
    same torques: or it is only a part of something else. (Of an LWR4+ one of whose runs had its fifth torque
    3 times too large nothing was said: the last two, mostly noise, gain more where they are swapped.)"""
    enough = (k for k, its in enumerate(found) if _explains(its, before))
    first = next((k for k in enough if _of_itself(before, owns, found[k])), None)
    if first is None or not _itself(asked, before, its := found[first]):
        return None
    more = [x for x in found[:first] if half_of(before, its.explained, x.explained)]
    rejected = steadily(its.explained, found[0].explained, RARE)
    return None if rejected or any(_of_itself(before, owns, x) for x in more) else its


def _contradicted(its: Changed) -> bool:
    """Whether torques are left that the others contradict: it is at most a part of what is wrong. (Of an
    LWR4+ whose joints were all logged one place further the first two positions looked swapped, which leaves
    the third torque at 97 %, by itself explained to 10 %.)"""
    explained = its.explained
    return bool(odd_beside(explained.fit.error, explained.quick.alone(explained.how)).any())


def _of_itself(before: Explained, owns: Sequence[Explained], its: Changed) -> bool:
    """Whether a fit of the recording alone explains it no worse than without the cause (owns: of each
    recording), and one fit of all recordings explains them about as fits of each do: a signal that is another
    one contradicts its own recording, too, or fits it as well, and beside nothing else makes one robot's
    recordings of them, or leaves little, and of most torques as much as those. (Of an LWR4+ whose other
    recording had no gravity in its torques a first position 10 times too small was told, of torques of
    another run two that look swapped; of a rokae with every second position turned, of four of whose torques
    twice to five times as much was left, the same as of the LWR4+.)"""

    each = []
    for own, so in zip(owns, its.explained.quick.samples):
        if its.recording in ("", so.label):
            changed = Explained.by(before.quick.of([so]), its.explained.how)
            if steadily(changed, own, RARE):
                return False
            own = changed
        each.append(own)
    usual = np.exp(np.mean(np.log(np.maximum([x.fit.error for x in each], FLOOR)), axis=0))
    plain, left = before.fit.error, its.explained.fit.error
    asks = np.full(len(left), True)
    of_torques = [name.startswith(("tau", "i")) for name in its.signals]
    if of_torques and all(of_torques):  # others may fit together as well anyway
        asks = beyond_own(plain, usual) | (np.abs(gains_of(plain, left)) > np.log(SAME))
    aim = np.fmin(plain, AS_OTHERS * usual)  # of few rows fits of each take what is no other signal's
    most = gain_of(plain[asks], left[asks]) > HALF * gain_of(plain[asks], aim[asks])
    as_others = _mean(left) < AS_OTHERS * _mean(usual)
    enough = _mean(left) < ENOUGH and beyond_own(left, usual).sum() <= len(left) / 2
    return bool(most and (as_others or enough))


def _itself(asked: Asked, before: Explained, its: Changed) -> bool:
    """Whether of torques that are other ones these themselves are explained better, not others alone. (Of an
    arm whose third torque a coupling to joint 2 lacked it was told to be 1.11 times too small in one run: the
    second torque left half then, the third more than before.)"""
    mine = [c for c in asked.seen if asked.name(c) in its.signals]
    return not mine or bool(its.explained.gains_over(before)[mine].sum() > 0)


def _mean(error: np.ndarray) -> float:
    """Geometric, of errors (C,)."""
    return float(np.exp(np.nanmean(np.log(np.maximum(error, FLOOR)))))


def _few(quick: Quick) -> Quick:
    """All rows as one, few enough to try a hundred motions."""
    whole = all_rows(quick)
    return whole.of([thinned(s) for s in whole.samples])


def _explains(its: Changed, before: Explained) -> bool:
    """Whether torques that are then explained gain as much as they have to, less what others lose. (Of an
    LWR4+ that judges with its third position turned nothing was told: the last torque is mostly noise, and
    was foretold better, too.)"""
    gains, error = its.explained.gains_over(before), np.nan_to_num(its.explained.fit.error)
    return bool(gains[(error <= EXPLAINED) | (gains < 0)].sum() > its.least)


def _instead(whole: Quick, its: Changed, asked: Asked) -> list[Changed]:
    """What a recording's own may be where one of its signals looks another: zeros of its torques, a body on
    the link on which it explains most (nearly what another zero does), other friction of joints whose torques
    look scaled."""
    if its.check not in NEAR_A_LOAD or not its.recording:
        return []
    columns, table = whole.columns, Geometry.of(whole.columns.model.geometry)
    (s,) = (s for s in whole.samples if s.label == its.recording)

    def beside(own: np.ndarray, words: str, do: str) -> Changed:
        samples = [
            x.beside(own if x is s else np.zeros((*x.W.shape[:2], own.shape[2]))) for x in whole.samples
        ]
        explained = Explained.by(whole.of(samples), asked.how)
        return Changed(s.label, (), "", words, do, explained)

    zeros = np.eye(len(columns.channels))[:, None, :].repeat(len(s.t), axis=1)
    out = [beside(zeros, "its torques start from other zeros", "take zeros alike in all recordings")]
    if columns.need.model != "D":
        bodies = standard(table, s.q, s.dq, s.ddq, free=False)[0][columns.joint_of]
        each = [bodies[:, :, 10 * link : 10 * link + 10] for link in range(len(table.rows))]
        loads = [beside(own, *LOAD) for own in each]
        out.append(min(loads, key=lambda load: float(np.nansum(np.log(load.explained.fit.error)))))
    if its.drives:
        names = [ParameterName.of(name) for name in columns.parameters]
        labels = {asked.joints[j] for j in its.drives}
        drives = [k for k, name in enumerate(names) if name and not name.of_body and name.label in labels]
        joints = f"joint{'s' if len(labels) > 1 else ''} {listed(sorted(labels))}"
        words = f"the friction of {joints} is another", f"look at the drive of {joints}"
        out += [beside(s.W[:, :, drives], *words)] if drives else []
    return out
