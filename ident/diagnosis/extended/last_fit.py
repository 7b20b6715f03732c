"""The extended study and its fit: what the loop found, fitted whole as `ident fit` does it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.special

from ident.diagnosis.evidence.state import State
from ident.diagnosis.extended.approximated import Moved, deviations, moved
from ident.diagnosis.extended.by_rows_that_judge import own_deviations
from ident.diagnosis.extended.in_a_study import study_term
from ident.diagnosis.extended.on_judging_runs import behind, counted_error, judged_error, spoilt
from ident.diagnosis.extended.remembered_path import along_the_better_path
from ident.diagnosis.extended.turning_over import turned_as_found
from ident.diagnosis.extended.unanswered import unanswered
from ident.diagnosis.loads.windows import windows_tried
from ident.diagnosis.opening import Opened
from ident.diagnosis.outcome import BUDGET, Outcome
from ident.diagnosis.rows.rows import Rows
from ident.equations.placing import entry_of
from ident.equations.terms import late_by
from ident.errors import FitFailedError, NotEnoughDataError, StudyError
from ident.estimation.fit import Examined, FitResult, fit_study
from ident.estimation.found_effects import FoundEffect, found_effects
from ident.examination.fits.hypothesis import EXPLAINED
from ident.progress import Progress


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why the last fit does without what the loop found: no fit of it, where neither is told. by_chance: p of
    sizes that are told too poorly; errors: percent of the runs that chose nothing, without it and with it."""

    by_chance: float | None = None
    errors: tuple[float, float] | None = None


Refused = dict[tuple, Refusal]  # by terms' keys


def first_extended(
    known: Examined, outcome: Outcome, base: FitResult, begun: Opened, alpha: float, progress: Progress
) -> tuple[Examined, FitResult, Refused]:
    """The study as all of its last fits take it, and the first of them (`extended`): at the cut-off of the
    loop, or at the study's own where the finer one predicts the runs that chose nothing worse than the study
    without findings does. (Between two motions of an LWR4+ the finer one alone takes joint 5 from 39 to 65 %:
    a model that lacks much is wrong by other parameters there, whatever was found.)"""
    study = known.prepared.study
    fine = max(base.cutoff_hz, min(0.5 * study.filter.position_cutoff_hz, begun.cutoff_hz))
    again = _at(known, outcome, fine)
    last, refused = extended(again, outcome, base, alpha, progress)
    if fine > base.cutoff_hz and (spoilt(last, base) or (last is base and outcome.steps)):
        coarse = _at(known, outcome, base.cutoff_hz)
        other, still = extended(coarse, outcome, base, alpha, progress)
        if spoilt(last, other):
            return coarse, other, still
    return again, last, refused


def _at(known: Examined, outcome: Outcome, cutoff: float) -> Examined:
    """The study at a cut-off [Hz]; where something was found, with the equations of it."""
    study = known.prepared.study
    settings = study.filter.model_copy(update={"decimation_cutoff_hz": cutoff})
    again = known.again(study.with_(filter=settings))
    if len(outcome.last.terms) == len(study.effects):
        return again
    late = late_by(again.prepared.columns, outcome.last.terms)
    return replace(again, prepared=again.prepared.with_late(late)).built()


def extended(
    known: Examined, outcome: Outcome, base: FitResult, alpha: float, progress: Progress
) -> tuple[FitResult, Refused]:
    """The study with the findings as its effects, fitted whole; without those that it does not need, and
    those that cannot be fitted there, or not well enough to be told from zero, or with which the torque is
    predicted no better, which are told. `known` is as `first_extended` has it. (Beside a force of 6 N, whose
    point the last fit moved, a body of 0.00 +- 0.01 kg was told as something that nothing explains.)"""
    refused: Refused = {}
    study = known.prepared.study
    declared, settings = len(study.effects), study.filter
    terms = outcome.last.terms[declared:]
    if not terms:
        return without_findings(base, outcome.last, known, progress), refused
    joints = base.columns.need.joints
    limit = alpha / BUDGET
    entries = [*study.effects, *(entry_of(study_term(t, outcome.last), joints) for t in terms)]
    keys = [*(() for _ in study.effects), *(t.key for t in terms)]
    known_by_judged = {t.key: own_deviations(outcome.last, t) for t in terms}
    windows = {t.key: windows_tried(outcome.last, t.place) for t in terms}

    def poorly(told: Sequence[FoundEffect], wider: Moved) -> list[int]:
        own = {k: (f, keys[k]) for k, f in enumerate(told) if k >= declared}
        by_chance = {
            k: _p_told(f, deviations(f, known_by_judged[key], wider.get(key, {})), windows[key])
            for k, (f, key) in own.items()
        }
        lost = _vague(told, by_chance, alpha)
        refused.update({keys[k]: Refusal(by_chance[k]) for k in lost})
        return lost

    while len(entries) > declared:
        extended = study.with_(effects=tuple(entries), filter=settings)
        try:
            last = fit_study(extended, progress=progress, known=known.again(extended))
        except (FitFailedError, NotEnoughDataError, StudyError):
            entries.pop()
            refused[keys.pop()] = Refusal()
            continue
        last = along_the_better_path(last, known, progress)
        settings = last.study.filter
        # with a sign that is too sharp its shape is fitted in an effect's place, or hides one in its error
        last = turned_as_found(last, outcome.last, known, progress)
        told = found_effects(last)
        if impossible := _impossible(told, declared, outcome.tau):
            at = max(impossible, key=lambda k: told[k].p_value)
            key, _ = keys.pop(at), entries.pop(at)
            if _needed(told[at], limit):  # something is there, and it is not this
                refused[key] = Refusal()
            continue
        lost = _weakest(told, declared, limit) or poorly(told, {})  # one: two can hide each other
        if not lost:
            worse = (
                _worse(last, known, declared, outcome.last.rows)
                or _in_vain(last, base, declared)
                or _alone(last, declared)
                or _beside_the_point(last, base, declared)
            )
            refused |= {keys[k]: Refusal(errors=errors) for k, errors in worse.items() if errors is not None}
            lost = list(worse) or _above(last, base, outcome.last.rows)
        if not lost:
            lost = poorly(told, moved(known, outcome.last, base, last))
        if not lost:
            return last, refused
        entries = [entry for k, entry in enumerate(entries) if k not in lost]
        keys = [key for k, key in enumerate(keys) if k not in lost]
    return without_findings(base, outcome.last, known, progress), refused


def without_findings(base: FitResult, state: State, known: Examined, progress: Progress) -> FitResult:
    """The study as it came; with dry friction turning over as the loop found it, where the runs that chose
    nothing are predicted worse without. (Of a joint that reverses within 8 mrad/s 9 % of the torque were
    left, and called noise; 0.8 are.)"""
    turned = turned_as_found(base, state, known, progress)
    return turned if spoilt(base, turned) else base


def _impossible(told: Sequence[FoundEffect], declared: int, tau: float) -> list[int]:
    """The numbers of findings whose values physics does not allow, or whose shape ends with its search."""
    return [k for k, f in enumerate(told) if k >= declared and (_ended(f) or not _possible(f, tau))]


def _possible(found: FoundEffect, tau: float) -> bool:
    """Whether physics allows the values of the fit, or others that it holds against by less than tau nats."""
    return found.term.effect.physical(found.term.values) is None and 0.5 * found.beyond**2 < tau


def _ended(found: FoundEffect) -> bool:
    """Whether a shape ends where its search does: something is there, and it is not this."""
    return any(
        (its := found.parameters.get(shape.name)) is not None
        and its.at_bound
        and not np.isclose(its.value, shape.grid, rtol=1e-6).any()  # a search begins there: it is no end
        for shape in found.term.effect.nonlinear
    )


def _weakest(told: Sequence[FoundEffect], declared: int, limit: float) -> list[int]:
    """The number of the finding that a fit needs least, of those that it does not need at the limit."""
    weak = [k for k, f in enumerate(told) if k >= declared and not _needed(f, limit)]
    return [max(weak, key=lambda k: (not told[k].essential, told[k].p_value))] if weak else []


def _needed(found: FoundEffect, limit: float) -> bool:
    return bool(found.essential and max(found.p_value, found.p_itself) < limit)


def _vague(told: Sequence[FoundEffect], by_chance: Mapping[int, float], alpha: float) -> list[int]:
    """The number of the finding that is told least well (`_p_told`), of those whose interval, as it is told,
    does not keep from zero at the rate of the study: of an AIRBOT a delay of 6.6 ms was established, +- 3.3
    ms by what its stretches say. (What the study itself left out is there whatever its interval.)"""
    vague = [k for k, p in by_chance.items() if p > alpha and not told[k].term.effect.replaces]
    return [max(vague, key=by_chance.__getitem__)] if vague else []


def _p_told(found: FoundEffect, by_judged: Mapping[str, float], windows: int = 1) -> float:
    """Of its sizes being zero: all at once by what the stretches say, its shapes as found; and as they are
    told (by_judged: deviations of what no fitted row shows), one by one, where none of them keeps from zero,
    however its shapes are. (Of a clean arm that never moved faster than 50 mrad/s a Stribeck friction was
    told, Fs = 37 +- 46 N m within 0.15 rad/s.) A factor has no shape and changes nothing at one, not at zero:
    its logarithm has been asked. (Of a TX40's second torque, five times too large, 7.1 +- 4.8 were found by
    59 nats.) A size with which alone it would be a simpler effect is that one's. (Of a gear that yields in
    proportion one that stiffens was told, by a cubic part of -2.0e-4 +- 1.9e-4.) All at once they pay for the
    `windows` of which that of a load has been chosen: of noise the loudest is there. (Beside torques that are
    late a force of 0.041 +- 0.015 N was told, p 0.0005, the best of some 170 windows.)"""
    if found.term.effect.factor(np.array(found.term.size)) != 1.0:
        return found.p_told
    simpler = {p.name for p in found.term.effect.linear if p.simpler}
    there = {n: p for n, p in found.parameters.items() if p.value or p.std}  # not held at none of it
    own = [n for n in found.term.effect.size_names if n not in simpler and n in there]
    sizes = [there[n] for n in own]
    stds = [by_judged.get(n, p.std) for n, p in zip(own, sizes)]
    far = [abs(p.value) / std for p, std in zip(sizes, stds) if std]
    alone = float(2 * scipy.special.ndtr(-max(far))) if far and len(far) == len(sizes) else 0.0
    return max(min(windows * found.p_told, 1.0), alone)


def _worse(
    last: FitResult, known: Examined, declared: int, rows: Rows
) -> dict[int, tuple[float, float] | None]:
    """The number of the last finding taken in with which the model predicts none of its channels better than
    without it alone, or all of them together worse, and these errors without it and with it; or, of a load on
    one recording, with which it predicts the others worse: as `ident fit` does it, it explains nothing. Of
    all samples and of those that the equations count. (Beside 0.2 mrad of play, found to 0.007 of it, 12 % of
    a torque were left for 7 and it was told that it is not this: at rest the filter's ringing moved the gear
    off its flank. Where the arm moves 0.8 % are left.)"""
    channels, effects = last.columns.need.channels, last.study.effects
    after, there = judged_error(last), counted_error(last, rows)
    for k in range(len(last.terms) - 1, declared - 1, -1):
        place = last.terms[k].place
        names = [last.columns.channels[c] for c in place.rows(channels)] if place.recording is None else []
        if not names and place.recording is None:
            continue
        without = last.study.with_(effects=(*effects[:k], *effects[k + 1 :]))
        other = fit_study(without, known=known.again(without))
        before = judged_error(other)
        without_it = counted_error(other, rows)
        nowhere = all(after[name] >= before[name] and there[name] >= without_it[name] for name in names)
        if names and (nowhere or _behind(last, other, rows)):
            said = min(names, key=lambda name: after[name] / max(before[name], 1e-9)) if nowhere else "total"
            return {k: (before[said], after[said])}
        if place.recording is not None and spoilt(last, other):
            return {k: None}
    return {}


def _in_vain(last: FitResult, base: FitResult, declared: int) -> dict[int, tuple[float, float] | None]:
    """The number of the last finding on one recording of which more is left with all that was found than by
    the study as it came, all channels together, and these errors: it is what its recording asked for. (Of a
    Franka whose fifth torque has another zero each way a body of 0.024 kg was told in one run, and its error
    there as 1.9 -> 2.4 %.)"""
    before, after = (fit.errors.full_rate.by_recording() for fit in (base, last))
    for k in range(len(last.terms) - 1, declared - 1, -1):
        run = last.terms[k].place.recording
        if run is not None and after[run]["total"] > before[run]["total"]:
            return {k: (before[run]["total"], after[run]["total"])}
    return {}


def _alone(last: FitResult, declared: int) -> dict[int, None]:
    """The number of the last finding that acts all along one recording, where no other recording is explained
    with it: what is in one recording throughout its own rows do not show, but others of the same robot. (Of a
    Franka with torques of the run that judges in per cent of what is rated a body was told in the one that is
    fitted, 72 % of the other were left for 76, and 212 for 2 of the one that decides nothing.)"""
    after = last.errors.full_rate.by_recording()
    tests = {entry.label for entry in last.study.recordings if entry.use == "test"}  # which decide nothing
    for k in range(len(last.terms) - 1, declared - 1, -1):
        place = last.terms[k].place
        if place.recording is None or place.comes_and_goes:
            continue
        others = [after[run]["total"] for run in after if run not in (place.recording, *tests)]
        if others and min(others) > 100 * EXPLAINED:
            return {k: None}
    return {}


def _beside_the_point(last: FitResult, base: FitResult, declared: int) -> dict[int, None]:
    """The number of the last finding that acts for a while in one recording whose torques, a check says, are
    not as they should be, where all that was found leaves that so: it is their shadow. (Of a KR 300 whose
    fifth torque leaps in one run a force of 792 +- 37 N on its hand was told from that moment on, with which
    16.3 of 18.7 % were left.)"""
    doubts = unanswered(base.checks, *(fit.errors.full_rate.by_recording() for fit in (base, last)))
    runs = {check.recording for check in doubts}
    for k in range(len(last.terms) - 1, declared - 1, -1):
        place = last.terms[k].place
        if place.recording in runs and place.comes_and_goes:
            return {k: None}
    return {}


def _behind(fit: FitResult, other: FitResult, rows: Rows) -> bool:
    """Of all samples, and of those that the equations count."""
    return behind(fit, other) and behind(fit, other, partial(counted_error, rows=rows))


def _above(last: FitResult, base: FitResult, rows: Rows) -> list[int]:
    """The number of the last finding taken in, where what would be handed over predicts the runs that chose
    nothing with a larger error than the study as it came. (A drift of a KR 300's third joint: 13 -> 11 % of
    that joint, and 37 -> 44 % of all.)"""
    return [len(last.terms) - 1] if _behind(last, base, rows) else []
