"""Every check of a study, in three stages, worst first; and the study with the gross faults undone.

    open_recordings   each table: time, lost samples, units, dead and resting channels, logged velocities
    examine_fit       a quick fit against physics: signs, scales, places of torques, gravity, the table's axes
    fit               what only its result shows: parameters not seen or beyond what robots are

Of the hypotheses of a quick fit the one that explains most is taken, applied, and the rest are asked again:
a torque with the other sign is not a tilted base as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import yaml

from ident.equations.prepared import Prepared, resting_joints
from ident.errors import IdentError
from ident.examination.another_clock import clock_of_all
from ident.examination.another_signal import another_signal
from ident.examination.axes import joint_axes
from ident.examination.base import Tilt, base_orientation, unseen
from ident.examination.bodies import Parts, beyond_own, errors, parts_of
from ident.examination.carried import CARRIED, Carried, ambiguous, carried_faults
from ident.examination.check import Check, refuse, turned_sign, worst_first
from ident.examination.coupled import coupled_positions
from ident.examination.currents import motor_signs
from ident.examination.delays import delays
from ident.examination.first_axis import FirstAxis
from ident.examination.frictionless import frictionless
from ident.examination.gravity import Direction, direction
from ident.examination.halves import of_either_half
from ident.examination.hypothesis import (
    CLEARLY,
    EXPLAINED,
    NOTHING,
    SAME,
    Asked,
    Hypothesis,
    bad,
    explains,
    not_recorded,
    of_several,
    signal_of,
)
from ident.examination.limits import beyond_limits, reads_currents
from ident.examination.magnitudes import magnitudes
from ident.examination.motions import by_themselves, moved_positions, signed
from ident.examination.places import other_orders, other_torques, swapped, swapped_positions
from ident.examination.quick import Fit, Quick, Sample, gain_of, gains_of, quick_of, take
from ident.examination.recordings_apart import foretold_badly, recordings_apart, recordings_unlike
from ident.examination.rivals import alike, rivals
from ident.examination.same_samples import same_samples
from ident.examination.scales import scales, too_large, turned_scales
from ident.examination.signs import SURE, all_signs, evidence, several_signs
from ident.examination.sphere import sought
from ident.examination.stopped_meanwhile import stopped_meanwhile
from ident.examination.stretches import RARE, Explained, all_rows, pieces, same, steadily
from ident.examination.turned import all_turned, one_turned, turned_positions
from ident.examination.unexplained import (
    apart_by_one_fit,
    contradicting,
    odd_beside,
    unexplained,
    unpredicted,
)
from ident.examination.units import degrees, geared, scaled_positions
from ident.examination.velocity import logged_velocities
from ident.examination.weightless import unfelt, weightless
from ident.examination.within import changed_within
from ident.recordings.study import Study

BROKEN = ("dead_channel", "unsigned_torque")  # of a torque, which is then asked nothing
FAULTS = 4  # at most, one after the other
DOUBTFUL = 0.15  # error of a channel from which several faults at once are asked for
TURNED = 0.05  # and that of gravity, which a slow motion hardly feels upside down
FALLEN, RISEN = 0.7, 1.02  # of the error before, at most: where one position is blamed, and anything else
ALIKE = 2  # causes beside the one that all recordings tell: of more none is told
FEW = 3  # joints: more of them show where gravity is, on all robots that were measured


def examine_tables(prepared: Prepared) -> tuple[Check, ...]:
    """What was found in the recordings when they were opened, and of them against the robot's limits."""
    found = [check for stream in prepared.streams for check in stream.checks]
    twice = sentences("same_rows", prepared.study.remarks)
    copied = same_samples(prepared.streams)
    return worst_first([*twice, *copied, *found, *beyond_limits(prepared)])


def examine_fit(prepared: Prepared) -> tuple[Check, ...]:
    """What a quick fit shows of signs, scales, places, gravity and axes, with the terms that the study leaves
    out: a torque that misses one looks scaled, or turned. (Of a KR 300 without its viscous friction two were
    told as turned.) Raises RecordingError where no number would mean anything (positions in degrees)."""
    if prepared.study.without and not prepared.study.effects:  # which may stand in their place
        prepared = prepared.again(prepared.study.with_(without=()))
    columns = prepared.columns
    samples = [
        s for role in ("identify", "validate") for s in take(prepared.streams, prepared.banks, columns, role)
    ]
    clipped = _clipped(prepared)
    samples = _unclipped(prepared, samples, clipped)
    broken = {n for s in prepared.streams for c in s.checks if c.check in BROKEN for n in c.signals}
    uneven = {s.label for s in prepared.streams for c in s.checks if c.check == "time_stamps" and c.remedy}
    still = np.flatnonzero(np.isin(columns.joint_of, resting_joints(prepared.streams))).tolist()
    samples = [s.without([*_channels(prepared, broken), *still]) for s in samples]
    for sample in samples:  # motor signals of unknown gain are no torques yet
        sample.weight[:, list(columns.gain_columns)] = 0.0
    if not any(s.role == "identify" for s in samples):
        return ()
    quick = quick_of(columns, samples)
    if not (quick.identify.rows > 10).any():
        return ()
    how, currents = quick.plain(), reads_currents(prepared)
    gains = _gains(prepared, currents)
    maps = dict(prepared.study.columns)
    anywhere = frozenset().union(*clipped.values())
    asked = Asked(quick, how, quick.fit(how), maps, currents, gains, _velocities(prepared), anywhere)
    dead = {n for s in prepared.streams for c in s.checks if c.check == "dead_channel" for n in c.signals}
    held = any(name[0] == "q" for name in dead)
    stopped = () if held else tuple(stopped_meanwhile(asked))
    if held or stopped:  # what else is odd is its shadow
        return stopped
    at_an_end = False
    found: list[Check] = []
    best: Hypothesis | None = None
    near: list[Hypothesis] = []
    gained, halfway = 0.0, list(changed_within(asked))
    turned = halfway[-1][1].fit(how).gain_over(asked.fit) if halfway else -np.inf
    for _ in range(FAULTS):
        told = _believable(prepared, asked)
        told = [_moving(asked, h) for h in told]
        if best is not None and near:  # asked again with the last one undone: no other name of it
            again = {(h.check.check, h.check.signals) for h in told}
            near = [h for h in near if (h.check.check, h.check.signals) not in again]
            found[-1] = best.beside(near).check
        at_an_end = bool(found) and not found[-1].signals
        if at_an_end:  # of so many causes none was told
            break
        best = max(told, key=lambda h: h.gain, default=None)
        odd = not found and (bool(told) or bad(asked.fit) or _unforeseen(asked.fit))
        moved = [] if found else list(another_signal(asked, told, positions=odd))
        moved = [c for c in moved if c.check != "clock_rate" or c.recording not in uneven]
        if moved:
            return tuple(moved)
        if best is None:
            break
        found.append(best.check)
        near = _alike(asked, best, told)
        gained += best.gain
        if best.check.outcome == "refused":
            stream = next(s for s in prepared.streams if s.role == "identify")
            refuse(stream.file, [*examine_tables(prepared), *found])
        at_an_end = asked.of_robot(best) or best.check.check in ("unrelated_torque", "dead_channel")
        if at_an_end:  # nothing here that later questions could stand on
            break
        asked = asked.after(best)
    if halfway and (not found or turned > gained):  # what else is odd is its shadow, or it is theirs
        return tuple(check for check, _ in halfway)
    if at_an_end:
        return tuple(found)
    doubted = any(check.hint for stream in prepared.streams for check in stream.checks)
    apart = [] if found or doubted else list(recordings_apart(asked.quick, asked.how))
    alone = list(another_signal(asked, ())) if apart and not odd else []
    alone = alone or list(recordings_unlike(asked, apart))
    found += motor_signs(asked)
    beside = alone or ([] if doubted or found else list(frictionless(asked)))
    beside = beside or ([] if doubted else list(unexplained(asked)))
    held = asked.fit.validate
    if (alone or not beside) and held is not None:
        asks = not found and gain_of(held, asked.fit.error) > CARRIED
        scaled = carried_faults(asked) if asks else []
        beside = [ambiguous(held, scaled)] if scaled else beside
        beside += _by_all(prepared, asked) if asks and not beside else []
        beside += [] if beside or doubted else unpredicted(asked)
    beside = beside or list(foretold_badly(asked, apart)) or list(contradicting(asked))
    if not (found or beside or doubted or bad(asked.fit)):
        beside += unfelt(asked)
    if not found and not beside and 1 < len(columns.need.joints) <= FEW:
        beside += _unseen(prepared, asked)
    return (*_joined(found, asked.maps), *beside)


def _by_all(prepared: Prepared, asked: Asked) -> list[Check]:
    """What all recordings together tell, where those that are fitted do not, and foretell the others badly.
    (Of three to five seconds of a rokae a factor, or a base on a wall, was another robot, or nothing.) It has
    to make one robot of the recordings."""
    whole = all_rows(asked.quick)
    both = replace(asked, quick=whole, fit=whole.fit(asked.how))
    told = _believable(prepared, both)
    best = max(told, key=lambda h: h.gain, default=None)
    if best is None or best.check.outcome == "refused":
        return []
    if not both.of_robot(best) and apart_by_one_fit(best.quick or whole, best.how).any():
        return []
    if best.quick is not None and _unforeseen(_in_roles(best.quick, asked.quick).fit(best.how)):
        return []
    near = _alike(both, best, told)
    if len(near) > ALIKE:
        return []
    check = best.beside(near).check
    return [replace(check, message=f"{check.message}, over all recordings")]


def _in_roles(moved: Quick, quick: Quick) -> Quick:
    """All rows with another motion, as what is fitted and what judges again."""
    role = {s.label: s.role for s in quick.samples}
    return moved.of([replace(s, role=role[s.label]) for s in moved.samples])


def _clipped(prepared: Prepared) -> dict[str, set[str]]:
    """Of every recording the torques that are."""
    return {
        s.label: {n for c in s.checks if c.check == "saturation" for n in c.signals} for s in prepared.streams
    }


def _unclipped(prepared: Prepared, samples: list[Sample], clipped: Mapping[str, set[str]]) -> list[Sample]:
    """Without what is clipped: no model explains it, and other faults took its place (of an AIRBOT's clipped
    torque a factor, of a Barrett's another zero was told)."""
    return [s.unclipped(_channels(prepared, clipped[s.label])) for s in samples]


def _channels(prepared: Prepared, signals: set[str]) -> list[int]:
    """Places of the torques that are read from these signals."""
    currents, columns = reads_currents(prepared), prepared.columns
    return [c for c in range(len(columns.channels)) if signal_of(columns, c, currents) in signals]


def sentences(check: str, texts: Iterable[str]) -> tuple[Check, ...]:
    """Warnings of a fit's result as checks."""
    return tuple(Check(check, (), text) for text in texts)


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
        return Explained.by(all_rows(h.quick or asked.quick), h.how)

    its = explained(best)
    others = [h for h in told if h.words not in ("", best.words) and not asked.of_robot(h)]
    near = robots + [h for h in others if not steadily(explained(h), its, RARE)]
    pool = rivals(whole, asked.how, asked.currents)
    also = alike((r for r in pool if not same(r.explained, its, 1e-6)), Explained.by(whole, asked.how), its)
    silent = replace(best.check, remedy="")
    return near + [Hypothesis(0.0, asked.how, silent, words=r.words) for r in also]


def _moving(asked: Asked, h: Hypothesis) -> Hypothesis:
    """Of a position that stands still in all recordings any other motion is one that was not recorded. (Of an
    LWR4+ whose fourth position did it was told as exchanged with the seventh.)"""
    still = asked.still(h.check.signals) if h.quick is not None else ()
    if not still:
        return h
    check = not_recorded(still)
    return replace(h, check=check, words=check.message)


def _believable(prepared: Prepared, asked: Asked) -> list[Hypothesis]:
    """What would explain torques that the model as it is does not; one where nothing else is to be asked."""
    everything = all_signs(asked)
    if everything is not None and not _unforeseen(asked.fit):  # whose friction a fit of nonsense tells
        right = [h for h in _positions(asked) if _believed(asked, h) and not _mirrored(asked, h)]
        return right or [all_turned(asked, everything)]
    doubted = [c for s in prepared.streams for c in s.checks if c.check == "torque_scale" and c.hint]
    large = too_large(asked, {name for c in doubted for name in c.signals})
    believed = next((h for h in large if _believed(asked, h)), None)
    if believed is not None:
        return [believed]
    error = asked.fit.error[np.isfinite(asked.fit.error)]
    found = [*one_turned(asked), *magnitudes(asked)]
    if not prepared.study.without:  # a torque that misses a term of the model looks scaled
        found += scales(asked)
    if error.max() > DOUBTFUL:
        found += [*several_signs(asked), *swapped(asked), *other_torques(asked), *degrees(asked)]
        found += turned_scales(asked) if not prepared.study.without else []
        found += coupled_positions(asked)
    if bad(asked.fit):
        found += [*_positions(asked), *geared(asked), *scaled_positions(asked), *other_orders(asked)]
    found += [*weightless(asked), *delays(asked), *clock_of_all(asked)]
    found.sort(key=lambda h: h.gain)  # of what was asked in several ways the one that explains most
    once = {(h.check.check, h.check.signals): h for h in found}
    found = [h for h in once.values() if _believed(asked, h)]
    hidden = _hidden(asked, found) if error.max() > DOUBTFUL else []
    if error.max() > TURNED:
        best = max((h.gain for h in found), default=0.0)
        geometry = list(_geometry(prepared, asked, best))
        each = max((its.each for its in geometry if isinstance(its, Hypothesis)), default=-np.inf)
        if hidden and hidden[0].gain > each + CLEARLY:
            return hidden
        for its in geometry:
            if isinstance(its, Tilt):
                found = [h for h in found if h.gain > its.gain or _beside(prepared, asked, h, its)]
            else:
                found.append(its)
    return found


def _hidden(asked: Asked, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Positions recorded otherwise by what every torque by itself says, where no hypothesis is found that
    explains them by themselves about as well, and together, too."""
    each = by_themselves(asked)
    contradict = beyond_own(asked.fit.error, each.fit.error).any()
    if not contradict and not bad(asked.fit):
        return []
    told = list(moved_positions(asked, each, zeros=bool(contradict)))
    told = [h for h in told if not (_unforeseen(asked.fit) and _unforeseen(asked.after(h).fit))]
    if not told:
        return []
    others = [(by_themselves(asked.after(h)), h) for h in found]
    as_well = [(its, h) for its, h in others if its.fit.gain_over(each.fit) > told[0].gain - CLEARLY]
    together = signed(by_themselves(asked.after(told[0])))
    assert together is not None
    kept = [not steadily(Explained.by(its.quick, h.how), together, RARE) for its, h in as_well]
    return [] if any(kept) else told


def _unforeseen(fit: Fit) -> bool:
    """Whether of a torque that judges the prediction is worse than none."""
    return fit.validate is not None and bool(np.nanmax(fit.validate, initial=0.0) > 1.0)


def _positions(asked: Asked) -> list[Hypothesis]:
    """Positions turned or swapped; without those of a mirrored arm, all of whose torques are then turned,
    where another one is not."""
    found = [*swapped_positions(asked), *turned_positions(asked)]
    return [h for h in found if not _mirrored(asked, h)] or found


def _mirrored(asked: Asked, h: Hypothesis) -> bool:
    return h.quick is not None and all_signs(asked.after(h)) is not None


def _beside(prepared: Prepared, asked: Asked, h: Hypothesis, tilt: Tilt) -> bool:
    """Whether a hypothesis explains beside a small tilt, which explains more, most of what it does without
    it: a UR10e's first torque looked three times too small where the base was tilted by 6 degrees."""
    made = [_parts(prepared, asked), _parts(prepared, asked.after(h))]
    before, after = (errors(m[3], None, tilt.gravity)[0] for m in made if m is not None)
    return gain_of(before, after) > 0.5 * h.gain


def _believed(asked: Asked, h: Hypothesis) -> bool:
    """Whether the model explains, and predicts, the signals that the hypothesis blames once it is taken; all
    of them where it blames positions, which stand in every torque, and clearly better than before, those
    that it touches, where it is one position alone: where something large is missing in the model (a cable
    over two joints, gravity elsewhere), one wrong sign or order may leave less without being the cause. A
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
    moved = {j for j, label in enumerate(joints) if f"q{label}" in h.check.signals}
    if motion and not of_several(asked.quick.columns, before, fit, moved):
        return False
    known = h.own or asked.of_robot(h) or not np.isfinite(h.gain)  # by friction, by size, or by no fit
    if not known and not of_either_half(asked.quick, asked.how, taken.quick, h.how):
        return False
    explained = explains(before.error[its], fit.error[its])
    worst = [0.0 if x.validate is None else float(np.nanmax(x.validate, initial=0.0)) for x in (fit, before)]
    predicted = not min(worst) > 1
    if motion and len(h.check.signals) == 1:
        touched = np.abs(gains_of(before.error, fit.error)) > np.log(SAME)  # a wrist's position moves its own
        return explained and predicted and fit.gain_over(before) > -np.log(FALLEN) * touched.sum()
    return explained and predicted and _rms(fit) < RISEN * _rms(before)


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


def _gains(prepared: Prepared, currents: bool) -> np.ndarray:
    """(C,) N m per unit of what is recorded of each channel, where the study knows it."""
    told, columns = prepared.study.drive_gains, prepared.columns
    if not currents or told is None or isinstance(told, str):
        return np.ones(len(columns.channels))
    motor = [c.side in ("motor", "drive") for c in columns.need.channels]
    return np.where(motor, np.array(told, float)[np.array(columns.joint_of, int)], 1.0)


def _velocities(prepared: Prepared) -> frozenset[str]:
    """Joints whose velocity is logged in every recording."""
    labels, maps = [str(joint) for joint in prepared.columns.need.joints], prepared.study.columns
    logged = [set(logged_velocities(labels, maps, stream.table)) for stream in prepared.streams]
    return frozenset(set(labels).intersection(*logged))


def _rms(fit: Fit) -> float:
    return float(np.sqrt(np.nanmean(fit.error**2)))


def _geometry(prepared: Prepared, asked: Asked, prior: float) -> Iterable[Hypothesis | Tilt]:
    """Gravity and the axes of the table; asked last because they cost most."""
    made = _parts(prepared, asked)
    if made is None:
        return
    table, samples, gravity, identify, validate = made
    columns, how = prepared.columns, asked.how

    def rivals() -> list[Carried]:
        return carried_faults(asked)

    def stretches() -> tuple[Parts, list[Parts]]:
        whole = all_rows(asked.quick.of(samples))
        parts = [parts_of(table, columns, [s.rows(k)], how) for s in whole.samples for k in pieces(whole, s)]
        one = parts_of(table, columns, whole.samples, how)
        assert one is not None
        return one, [its for its in parts if its is not None]

    def measured(near: np.ndarray, aside: Sequence[int]) -> Direction:
        whole = all_rows(asked.quick.of([s.without(aside) for s in samples]))
        return direction(table, whole, how, near)

    alone = prior == 0 and how == asked.quick.plain()
    others, names = rivals if alone else None, asked.names(range(len(columns.channels)))
    asks = (others, stretches, names, None, measured, FirstAxis.of(table, asked.joints))
    tilted = list(base_orientation(identify, validate, gravity, how, *asks))
    yield from tilted
    # a row of the table may stand for the base, or for a joint that is recorded the other way
    clearly = [its.gain + CLEARLY * isinstance(its, Hypothesis) for its in tilted]
    prior = max([prior + CLEARLY if prior else 0.0, *clearly])
    for axis in joint_axes(table, columns, samples, gravity, how, prior):
        plain = errors(identify, None, gravity)[0]
        best = sought(identify, plain, float(np.linalg.norm(gravity)) or 9.81)[0]
        if axis.gain > gain_of(plain, errors(identify, None, best)[0]):
            yield axis


def _unseen(prepared: Prepared, asked: Asked) -> Iterable[Check]:
    made = _parts(prepared, asked)
    return () if made is None else unseen(made[3], made[4], made[2])


def _parts(prepared: Prepared, asked: Asked) -> tuple[Any, ...] | None:
    """Table, samples of the usual load, gravity (3,) as the study has it, parts of identify and validate."""
    from modelgen.geometry.kinematics import Geometry

    study, columns, everything = prepared.study, prepared.columns, asked.quick.samples
    table = Geometry.of(columns.model.geometry)
    loads = [s.payload for s in everything]
    usual = max(set(loads), key=loads.count)
    samples = [s for s in everything if s.payload == usual]
    fitted, held = ([s for s in samples if s.role == role] for role in ("identify", "validate"))
    if not fitted or len([row for row in table.rows if row.sigma != 2]) != everything[0].q.shape[1]:
        return None
    gravity = np.array(study.gravity if study.gravity is not None else [float(g) for g in table.gravity])
    identify = parts_of(table, columns, fitted, asked.how)
    if identify is None:
        return None
    return table, samples, gravity, identify, parts_of(table, columns, held, asked.how)


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


def undoing(check: Check) -> dict[str, Any] | None:
    """The line of a study that undoes what a check found; None where it has none, or more than one."""
    if check.outcome != "warned" or not check.remedy:
        return None
    try:
        line = yaml.safe_load(check.remedy)
    except yaml.YAMLError:
        return None
    return line if isinstance(line, dict) and set(line) <= {"columns", "gravity", "recordings"} else None


def mended_study(study: Study, checks: Iterable[Check]) -> Study | None:
    """The study with the remedies of its gross faults written in; None where there is nothing to undo.

    A remedy is the study's own line (`columns: {tau_m3: {sign: -1}}`, `gravity: [9.81, 0, 0]`, or one
    recording's, `recordings: [{name: run1, columns: ...}]`), so what is applied here is what a person would
    paste. Maps that a recording has of its own change alike.
    """
    changes: dict[str, Any] = {}
    columns, own = dict(study.columns), [dict(entry.columns) for entry in study.recordings]
    for check in checks:
        line = undoing(check)
        if line is None:
            continue
        changes |= {key: tuple(value) for key, value in line.items() if key == "gravity"}
        for name, value in line.get("columns", {}).items():
            before = columns.get(name)
            columns[name] = _column(name, value)
            for maps in own:
                if name in maps and before is not None:
                    maps[name] = _of_its_own(maps[name], before, columns[name])
        changes["columns"] = columns
        for its in line.get("recordings", ()):
            maps = own[[entry.label for entry in study.recordings].index(its["name"])]
            for name, value in its["columns"].items():
                before, after = columns.get(name, _column(name, {})), _column(name, value)
                maps[name] = _of_its_own(maps[name], before, after) if name in maps else after
    if not changes:
        return None
    if any(own):
        changes["recordings"] = tuple(
            entry.model_copy(update={"columns": maps}) for entry, maps in zip(study.recordings, own)
        )
    try:
        return study.with_(**changes)
    except (IdentError, ValueError):
        return None


def _of_its_own(own: Any, before: Any, after: Any) -> Any:
    """A recording's own map, changed as the study's is from one to another."""
    sign, scale = own.sign * before.sign * after.sign, own.scale * after.scale / before.scale
    return own.model_copy(update={"sign": sign, "scale": scale})


def _column(name: str, value: Any) -> Any:
    from ident.recordings.study import ColumnMap

    plain = value if isinstance(value, dict) else {"column": value}
    return ColumnMap(**({"column": name} | plain))
