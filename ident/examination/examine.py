"""Every check of a study, in three stages, worst first.

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

from ident.equations.prepared import Prepared, resting_joints
from ident.examination.check import Check, listed, refuse, turned_sign, worst_first
from ident.examination.fits.bodies import beyond_own
from ident.examination.fits.hypothesis import (
    CLEARLY,
    EXPLAINED,
    Asked,
    Hypothesis,
    bad,
    not_recorded,
    signal_of,
)
from ident.examination.fits.quick import Fit, Quick, gain_of, quick_of
from ident.examination.fits.samples import Sample, take
from ident.examination.fits.stretches import RARE, Explained, all_rows, same, steadily
from ident.examination.fits.unexplained import (
    apart_by_one_fit,
    badly_explained,
    contradicting,
    unexplained,
    unpredicted,
)
from ident.examination.one_recording.another_clock import clock_of_all
from ident.examination.one_recording.another_signal import another_signal, more_in_one
from ident.examination.positions.coupled import coupled_positions
from ident.examination.positions.motions import by_themselves, moved_positions, signed
from ident.examination.positions.places import other_orders, other_torques, swapped, swapped_positions
from ident.examination.positions.units import degrees, geared, scaled_positions
from ident.examination.rivals.carried import CARRIED, ambiguous, carried_faults
from ident.examination.rivals.for_a_time import for_a_time
from ident.examination.rivals.other_zeros import other_zeros
from ident.examination.rivals.recordings_apart import (
    foretold_badly,
    halves_apart,
    recordings_apart,
    recordings_unlike,
)
from ident.examination.rivals.rivals import Rival, alike, rivals
from ident.examination.rivals.scales import scales, too_large, turned_scales
from ident.examination.rivals.stopped_meanwhile import stopped_meanwhile
from ident.examination.rivals.wandering import wandering
from ident.examination.robot.base import Tilt
from ident.examination.robot.geometry import beside_tilt, of_geometry, tables_instead, unseen_base
from ident.examination.robot.left_out import asked_for
from ident.examination.robot.lengths import lengths
from ident.examination.robot.tilted import tilted
from ident.examination.tables.limits import beyond_limits, reads_currents
from ident.examination.tables.same_samples import same_samples
from ident.examination.tables.velocity import logged_velocities
from ident.examination.torques.believed import believed
from ident.examination.torques.currents import motor_signs
from ident.examination.torques.delays import delays
from ident.examination.torques.frictionless import frictionless
from ident.examination.torques.magnitudes import magnitudes
from ident.examination.torques.signs import all_signs, several_signs
from ident.examination.torques.turned import all_turned, one_turned, turned_positions
from ident.examination.torques.weightless import unfelt, weightless
from ident.examination.torques.within import changed_within

BROKEN = ("dead_channel", "unsigned_torque")  # of a torque, which is then asked nothing
FAULTS = 4  # at most, one after the other
DOUBTFUL = 0.15  # error of a channel from which several faults at once are asked for
TURNED = 0.05  # and that of gravity, which a slow motion hardly feels upside down
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
    study = prepared.study
    whole_model = not study.effects  # which may stand in the place of what is left out
    if study.without and whole_model:
        prepared = prepared.again(study.with_(without=()))
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
    its = quick, how, quick.fit(how), maps, currents, gains, _velocities(prepared), anywhere
    asked = Asked(*its, _hidden_steps(prepared))
    dead = {(s.label, c.signals) for s in prepared.streams for c in s.checks if c.check == "dead_channel"}
    lost = {(label, signals) for label, signals in dead if signals[0][0] == "q"}
    stopped = tuple(c for c in stopped_meanwhile(asked) if (c.recording, c.signals) not in lost)
    if lost or stopped:  # what else is odd is its shadow
        return stopped
    at_an_end = False
    found: list[Check] = []
    best: Hypothesis | None = None
    near: list[Hypothesis] = []
    gained, halfway = 0.0, list(changed_within(asked))
    said = [check for stream in prepared.streams for check in stream.checks]
    doubted, leapt = any(c.hint for c in said), any(c.check == "torque_step" for c in said)
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
            return tuple(c for c in moved if c.check != "unrelated_torque" or not leapt)  # that tells by what
        if best is None:
            break
        found.append(best.check)
        near = [*_alike(asked, best, told), *_tables(prepared, asked, best), *_unrecorded(asked, best)]
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
    apart = [] if found or doubted else list(recordings_apart(asked.quick, asked.how))
    alone = list(another_signal(asked, ())) if apart and not odd else []
    alone = alone or list(recordings_unlike(asked, apart))
    found += motor_signs(asked)
    beside = alone or ([] if doubted or found else list(frictionless(asked)))
    beside = beside or ([] if doubted else list(unexplained(asked)))
    held = asked.fit.validate
    if (alone or not beside) and held is not None:
        elsewhere = any(c.hint and c.signals[0][0] == "q" for s in prepared.streams for c in s.checks)
        asks = not found and not elsewhere and gain_of(held, asked.fit.error) > CARRIED
        scaled = carried_faults(asked) if asks else []
        beside = [ambiguous(held, scaled)] if scaled else beside
        beside += _by_all(prepared, asked) if asks and not beside else []
    beside += [] if beside or doubted or found else [h.check for h in lengths(prepared, asked)]
    meanwhile = [] if beside or doubted or found else list(for_a_time(asked))
    beside += [] if beside or doubted or meanwhile else unpredicted(asked)
    beside += [c for c in meanwhile if len(c.signals) > 1]  # which no torque's zero makes so
    beside += [] if beside or doubted else wandering(asked)
    beside += [] if beside or doubted else tilted(prepared, asked)
    beside += [] if beside or doubted or found else other_zeros(asked)
    beside = beside or meanwhile or list(foretold_badly(asked, apart)) or list(contradicting(asked))
    beside += [] if beside or doubted or found else halves_apart(asked)
    beside += [] if beside or doubted or found else badly_explained(asked)
    if not (found or beside or doubted or bad(asked.fit)):
        beside += unfelt(asked)
    beside += asked_for(study, asked) if whole_model else []
    if not found and not beside and 1 < len(columns.need.joints) <= FEW:
        beside += unseen_base(prepared, asked)
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
    made = best.quick or whole
    of_robot = both.of_robot(best)
    if not of_robot and apart_by_one_fit(made, best.how).any():
        return []
    of_all = not of_robot and (best.quick is not None or not best.check.signals)  # or nothing tells which
    if of_all and _unforeseen(_in_roles(made, asked.quick).fit(best.how)):
        return []
    near = [*_alike(both, best, told), *_tables(prepared, both, best)]
    known = both.of_robot(best) or best.own or not np.isfinite(best.gain)  # by friction, not by what is left
    if len(near) > ALIKE or (not known and more_in_one(both, best)):
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
        return Explained.less(all_rows(h.quick or asked.quick), h.how, whole)

    its = explained(best)
    others = [h for h in told if h.words not in ("", best.words) and not asked.of_robot(h)]
    near = robots + [h for h in others if not steadily(explained(h), its, RARE)]

    def once_more(r: Rival) -> bool:  # itself, or the same by a number a little off
        of_it = r.joint is not None and f"q{asked.joints[r.joint]}" in best.check.signals
        return (of_it and r.check == best.check.check) or same(r.explained, its, 1e-6)

    pool = (r for r in rivals(whole, asked.how, asked.currents) if not once_more(r))
    also = alike(pool, Explained.by(whole, asked.how), its)
    return near + _silent(asked, best, [r.words for r in also])


def _tables(prepared: Prepared, asked: Asked, best: Hypothesis) -> list[Hypothesis]:
    """Tables of the robot that are not rejected beside torques taken otherwise."""
    if best.own or not np.isfinite(best.gain) or asked.of_robot(best) or not best.check.signals:
        return []
    return _silent(asked, best, tables_instead(prepared, asked, best))


def _unrecorded(asked: Asked, best: Hypothesis) -> list[Hypothesis]:
    """Positions that are one number in all recordings, as none is that was recorded. (Of a Barrett without
    its first one its second torque was told to have the other sign.)"""
    every = np.concatenate([s.q for s in asked.quick.samples])
    still = [f"q{asked.joints[j]}" for j in np.flatnonzero(np.ptp(every, axis=0) == 0)]
    words = f"{listed(still)} {'is' if len(still) == 1 else 'are'} not recorded, though the joint moves"
    return _silent(asked, best, [words] if still and best.check.check != "dead_channel" else [])


def _silent(asked: Asked, best: Hypothesis, words: Sequence[str]) -> list[Hypothesis]:
    """What may be there in the place of the best one, with no line that undoes it."""
    return [Hypothesis(0.0, asked.how, replace(best.check, remedy=""), words=its) for its in words]


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
    torques = all_signs(asked)
    everything = torques and all_turned(asked, torques)
    if everything and not _nonsense(asked.after(everything).fit):
        right = [h for h in _positions(asked) if believed(asked, h) and not _mirrored(asked, h)]
        return right or [everything]
    doubted = [c for s in prepared.streams for c in s.checks if c.check == "torque_scale" and c.hint]
    large = list(too_large(asked, {name for c in doubted for name in c.signals}))
    large = [h for h in large if believed(asked, h)][:1]
    if large:
        return large
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
    clocks = list(clock_of_all(asked))
    longer = list(lengths(prepared, asked)) if clocks else []  # by which bodies weigh otherwise, too
    clocks = [h for h in clocks if all(h.gain > its.gain for its in longer)]
    found += [*weightless(asked), *delays(asked), *clocks]
    found.sort(key=lambda h: h.gain)  # of what was asked in several ways the one that explains most
    once = {(h.check.check, h.check.signals): h for h in found}
    found = [h for h in once.values() if believed(asked, h)]
    found += [] if clocks else longer
    hidden = _hidden(asked, found) if error.max() > DOUBTFUL else []
    if error.max() > TURNED:
        best = max((h.gain for h in found), default=0.0)
        geometry = list(of_geometry(prepared, asked, best))
        each = max((its.each for its in geometry if isinstance(its, Hypothesis)), default=-np.inf)
        if hidden and hidden[0].gain > each + CLEARLY:
            return hidden
        for its in geometry:
            if isinstance(its, Tilt):
                found = [h for h in found if h.gain > its.gain or beside_tilt(prepared, asked, h, its)]
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


def _nonsense(fit: Fit) -> bool:
    """Whether it explains not all of what is fitted, nor foretells what judges: its friction may be anything.
    (A clean LWR4+'s first run, explained, foretells its second no better; of neither were turned positions
    told.)"""
    return bool(np.nanmax(fit.error) > EXPLAINED) and _unforeseen(fit)


def _positions(asked: Asked) -> list[Hypothesis]:
    """Positions turned or swapped; without those of a mirrored arm, all of whose torques are then turned,
    where another one is not."""
    found = [*swapped_positions(asked), *turned_positions(asked)]
    return [h for h in found if not _mirrored(asked, h)] or found


def _mirrored(asked: Asked, h: Hypothesis) -> bool:
    return h.quick is not None and all_signs(asked.after(h)) is not None


def _gains(prepared: Prepared, currents: bool) -> np.ndarray:
    """(C,) N m per unit of what is recorded of each channel, where the study knows it."""
    told, columns = prepared.study.drive_gains, prepared.columns
    if not currents or told is None or isinstance(told, str):
        return np.ones(len(columns.channels))
    motor = [c.side in ("motor", "drive") for c in columns.need.channels]
    return np.where(motor, np.array(told, float)[np.array(columns.joint_of, int)], 1.0)


def _hidden_steps(prepared: Prepared) -> np.ndarray:
    """(n,) rad | m, of all recordings the largest."""
    none = np.zeros(len(prepared.columns.need.joints))
    return np.max([none, *(np.array(bank.hidden) for bank in prepared.banks if bank.hidden)], axis=0)


def _velocities(prepared: Prepared) -> frozenset[str]:
    """Joints whose velocity is logged in every recording."""
    labels, maps = [str(joint) for joint in prepared.columns.need.joints], prepared.study.columns
    logged = [set(logged_velocities(labels, maps, stream.table)) for stream in prepared.streams]
    return frozenset(set(labels).intersection(*logged))


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
