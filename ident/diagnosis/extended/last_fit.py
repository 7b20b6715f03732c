"""The extended study and its fit: what the loop found, fitted whole as `ident fit` does it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.special

from ident.diagnosis.evidence.state import State, shown
from ident.diagnosis.extended.by_rows_that_judge import own_deviations
from ident.diagnosis.left_over import leftovers
from ident.diagnosis.opening import Opened
from ident.diagnosis.outcome import BUDGET, Outcome
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.parameters_apart import beside_changes
from ident.diagnosis.search.settling import place_of
from ident.diagnosis.search.weighing import Equivalent, simplicity
from ident.diagnosis.weighed_again import swapped
from ident.equations.observation import RecordingSystem, stack
from ident.equations.placing import entry_of
from ident.equations.terms import Term as StudyTerm
from ident.equations.terms import late_by
from ident.errors import FitFailedError, NotEnoughDataError, StudyError
from ident.estimation.fit import Examined, FitResult, fit_study
from ident.estimation.found_effects import FoundEffect, found_effects
from ident.estimation.least_squares import joint_sigma, rows_left, weighted_least_squares
from ident.progress import Progress, silent
from ident.recordings.study import Study
from ident.signals.filtering import STEEPNESS, prepare


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why the last fit does without what the loop found: no fit of it, where neither is told. by_chance: p of
    sizes that are told too poorly; errors: percent of the runs that chose nothing, without it and with it."""

    by_chance: float | None = None
    errors: tuple[float, float] | None = None


Refused = dict[tuple, Refusal]  # by terms' keys
SPOILT = 0.02  # of the error of the runs that chose nothing: more is no rounding


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
    declared = len(study.effects)
    terms = outcome.last.terms[declared:]
    if not terms:
        return without_findings(base, outcome.last, known, progress), refused
    joints = base.columns.need.joints
    limit = alpha / BUDGET
    entries = [*study.effects, *(entry_of(_study_term(t, outcome.last), joints) for t in terms)]
    keys = [*(() for _ in study.effects), *(t.key for t in terms)]
    known_by_judged = {t.key: own_deviations(outcome.last, t) for t in terms}
    while len(entries) > declared:
        extended = study.with_(effects=tuple(entries))
        try:
            last = fit_study(extended, progress=progress, known=known.again(extended))
        except (FitFailedError, NotEnoughDataError, StudyError):
            entries.pop()
            refused[keys.pop()] = Refusal()
            continue
        told = found_effects(last)
        if _impossible(told, declared):  # with a sign that is too sharp it is the sign's shape that is fitted
            last = _turned(last, outcome.last, known, progress)
            told = found_effects(last)
        if impossible := _impossible(told, declared):
            at = max(impossible, key=lambda k: told[k].p_value)
            key, _ = keys.pop(at), entries.pop(at)
            if _needed(told[at], limit):  # something is there, and it is not this
                refused[key] = Refusal()
            continue
        lost = _weakest(told, declared, limit)  # one: two can hide each other
        if not lost:
            last = _turned(last, outcome.last, known, progress)
            told = found_effects(last)
            lost = _weakest(told, declared, limit)  # a friction that turns over can do without
        if not lost:
            by_chance = {k: _p_told(f, known_by_judged[keys[k]]) for k, f in enumerate(told) if k >= declared}
            lost = _vague(told, by_chance, alpha)
            refused |= {keys[k]: Refusal(by_chance[k]) for k in lost}
        if not lost:
            worse = _worse(last, known, declared)
            refused |= {keys[k]: Refusal(errors=errors) for k, errors in worse.items() if errors is not None}
            lost = list(worse) or _above(last, base)
        if not lost:
            return last, refused
        entries = [entry for k, entry in enumerate(entries) if k not in lost]
        keys = [key for k, key in enumerate(keys) if k not in lost]
    return without_findings(base, outcome.last, known, progress), refused


def without_findings(base: FitResult, state: State, known: Examined, progress: Progress) -> FitResult:
    """The study as it came; with dry friction turning over as the loop found it, where the runs that chose
    nothing are predicted worse without. (Of a joint that reverses within 8 mrad/s 9 % of the torque were
    left, and called noise; 0.8 are.)"""
    turned = _turned(base, state, known, progress)
    return turned if spoilt(base, turned) else base


def _impossible(told: Sequence[FoundEffect], declared: int) -> list[int]:
    """The numbers of findings whose values physics does not allow, or whose shape ends with its search."""
    return [k for k, f in enumerate(told) if k >= declared and (_ended(f) or not _possible(f.term))]


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


def _p_told(found: FoundEffect, by_judged: Mapping[str, float]) -> float:
    """Of its sizes being zero: all at once by what the stretches say, its shapes as found; and as they are
    told (by_judged: deviations of what no fitted row shows), one by one, where none of them keeps from zero,
    however its shapes are. (Of a clean arm that never moved faster than 50 mrad/s a Stribeck friction was
    told, Fs = 37 +- 46 N m within 0.15 rad/s.) A factor has no shape and changes nothing at one, not at zero:
    its logarithm has been asked. (Of a TX40's second torque, five times too large, 7.1 +- 4.8 were found by
    59 nats.) A size with which alone it would be a simpler effect is that one's. (Of a gear that yields in
    proportion one that stiffens was told, by a cubic part of -2.0e-4 +- 1.9e-4.)"""
    if found.term.effect.factor(np.array(found.term.size)) != 1.0:
        return found.p_told
    simpler = {p.name for p in found.term.effect.linear if p.simpler}
    own = [n for n in found.term.effect.size_names if n not in simpler and n in found.parameters]
    sizes = [found.parameters[n] for n in own]
    stds = [by_judged.get(n, p.std) for n, p in zip(own, sizes)]
    far = [abs(p.value) / std for p, std in zip(sizes, stds) if std]
    alone = float(2 * scipy.special.ndtr(-max(far))) if far and len(far) == len(sizes) else 0.0
    return max(found.p_told, alone)


def replaced(
    known: Examined,
    outcome: Outcome,
    base: FitResult,
    last: FitResult,
    refused: Refused,
    alpha: float,
) -> tuple[Outcome, FitResult, Refused]:
    """In the place of what the last fit could not be made of, what was as likely in the loop."""
    for at, step in enumerate(outcome.steps):
        for rival in step.equivalent if step.term.key in refused else ():
            other = swapped(outcome, at, rival.term)
            if other is outcome:
                continue
            fit, still = extended(known, other, base, alpha, silent)
            if is_told(fit, rival.term):
                left = tuple(e for e in step.equivalent if e is not rival)
                outcome = other.with_step(at, replace(other.steps[at], equivalent=left))
                last, refused = fit, still
                break
    return outcome, last, refused


def compared_exactly(
    known: Examined, outcome: Outcome, base: FitResult, last: FitResult, refused: Refused, alpha: float
) -> tuple[Outcome, FitResult, Refused]:
    """Explanations that act on the model's own torque (a delay, a lag, a soft gear) compared by their last
    fits: in the loop their columns are made with the model that stood beside them, which favours the one
    that it was settled with. Those that the best one on the rows that chose nothing is not ahead of by the
    limit cannot be told apart: the simplest is told, and the others beside it."""
    for at, step in enumerate(outcome.steps):
        there = {t.key for t in outcome.last.terms}
        rivals = [t for t in step.passed if t.size is not None and t.key not in there]
        if step.term.size is None or not rivals or not is_told(last, step.term):
            continue
        tried = [(outcome, last, refused)]
        for rival in rivals:
            other = swapped(outcome, at, rival)
            if other is outcome:
                continue
            fit, still = extended(known, other, base, alpha, silent)
            if is_told(fit, rival):
                tried.append((other, fit, still))
        terms = [other.steps[at].term for other, _, _ in tried]
        places = {tuple(t.place.rows(outcome.last.model.channels)) for t in terms}
        own_rows = places.pop() if len(places) == 1 else ()  # in different channels: all answer
        fits = _beside_the_same(known, [(other, fit) for other, fit, _ in tried], at, base, alpha)
        nats = [_nats(outcome.last, fit, own_rows) for fit in fits]
        limit = outcome.tau * _overdispersion(outcome, step.term)
        equal = [k for k, n in enumerate(nats) if n > max(nats) - limit]
        best = min(equal, key=lambda k: (*simplicity(terms[k]), -nats[k]))
        own = step.evidence.log_e
        told = tuple(Equivalent(terms[k], own + nats[k] - nats[best]) for k in equal if k != best)
        keys = {term.key for term in terms}
        others = tuple(e for e in step.equivalent if e.term.key not in keys)
        outcome, last, refused = tried[best]
        outcome = outcome.with_step(at, replace(outcome.steps[at], equivalent=(*told, *others)))
        outcome = _left_anew(outcome, alpha) if best else outcome
    return outcome, last, refused


def _left_anew(outcome: Outcome, alpha: float) -> Outcome:
    """Without what functions explained beside another explanation, and explain no more beside this one."""
    first = [u for u in outcome.unnamed if u.nearest is not None]  # asked for; the others were left over
    if len(first) == len(outcome.unnamed):
        return outcome
    *_, left = leftovers(outcome.last, list(outcome.steps), first, outcome.tau, alpha)
    there = {u.channel for u in (*first, *left)}
    return replace(outcome, unnamed=tuple(u for u in outcome.unnamed if u.channel in there))


def _beside_the_same(
    known: Examined, tried: Sequence[tuple[Outcome, FitResult]], at: int, base: FitResult, alpha: float
) -> list[FitResult]:
    """The fits of several explanations of a step, each beside those effects only that all of them are told
    with: what one is ahead by because more stands beside it speaks not for it. (Of a UR10e's joint 2, 20 ms
    late, a lag was ahead by the hysteresis of 7 +- 3 N m that the delay's fit was not told with.)"""
    out = []
    for outcome, fit in tried:
        own = outcome.steps[at].term
        beside = [t for t in outcome.last.terms if t.key != own.key and is_told(fit, t)]
        extra = {t.key for t in beside if not all(is_told(other, t) for _, other in tried)}
        if extra:
            found = tuple(f for f in outcome.last.found if f.term is None or f.term.key not in extra)
            fewer = replace(outcome, last=replace(outcome.last, found=found))
            again, _ = extended(known, fewer, base, alpha, silent)
            fit = again if is_told(again, own) else fit
        out.append(fit)
    return out


def _overdispersion(outcome: Outcome, term: Term) -> float:
    """How many times too large noise is, where a term acts."""
    number = place_of(outcome.last, term)
    if number is None:
        return 1.0
    changes = beside_changes(outcome.last.but(number), outcome.last.found[number], outcome.tau)
    return 1.0 if changes is None else changes.kappa


def is_told(fit: FitResult, term: Term) -> bool:
    return any(same(told, term) for told in fit.terms)


def _nats(state: State, fit: FitResult, own: Collection[int]) -> float:
    """What the runs that chose nothing say given the fitted ones, each row as much as it is news in the
    state's noise; of the channels that the explanation acts in, or all. The fit's parameters are free in
    both, so that what the fitted runs leave open counts for nothing. (Of a rokae whose torques are all late
    the first one was told: parameters of seven seconds predict the next ones wrongly by 3 to 58 %, whatever
    is late.)"""
    fitted = [system for system in fit.systems if system.role == "identify"]
    every = [*fitted, *(system for system in fit.systems if system.role == "validate")]
    told = _likelihood(fit, every)
    if len(every) > len(fitted):
        told = told - _likelihood(fit, fitted)
    rows = np.array([max(factor.rows, 1) for factor in stack(every)])
    news = (state.rows.use & state.rows.usable).sum(axis=1) * [w.news for w in state.whiteners]
    told = told * np.minimum(news / rows, 1.0)
    return float(told[list(own)].sum() if own else told.sum())


def _likelihood(fit: FitResult, systems: Sequence[RecordingSystem]) -> np.ndarray:
    """(channels,) its logarithm, but for a constant, of the rows of some recordings, the parameters free."""
    factors, full = stack(systems), fit.full
    its = weighted_least_squares(factors, full.sigma, full.parameters, full.active, full.held)
    free = rows_left(factors, its.covariance, full.sigma)
    return np.asarray(-free * np.log(joint_sigma(factors, its.chi, its.covariance, full.sigma)))


def _possible(term: StudyTerm) -> bool:
    """Whether physics allows the values of the fit."""
    return term.effect.physical({**dict(zip(term.linear, term.size)), **term.theta}) is None


def _ended(found: FoundEffect) -> bool:
    """Whether a shape ends where its search does: something is there, and it is not this."""
    return any(
        (its := found.parameters.get(shape.name)) is not None
        and its.at_bound
        and not np.isclose(its.value, shape.grid, rtol=1e-6).any()  # a search begins there: it is no end
        for shape in found.term.effect.nonlinear
    )


def _judged(fit: FitResult) -> Mapping[str, float]:
    """Percent of the runs that chose nothing, where there are such."""
    return fit.full_rate_error.get("validate") or fit.full_rate_error["identify"]


def _worse(last: FitResult, known: Examined, declared: int) -> dict[int, tuple[float, float] | None]:
    """The number of the last finding taken in with which the model predicts none of its channels better than
    without it alone, or all of them together worse, and these errors without it and with it; or, of a load on
    one recording, with which it predicts the others worse: as `ident fit` does it, it explains nothing."""
    channels, effects, after = last.columns.need.channels, last.study.effects, _judged(last)
    for k in range(len(last.terms) - 1, declared - 1, -1):
        place = last.terms[k].place
        names = [last.columns.channels[c] for c in place.rows(channels)] if place.recording is None else []
        if not names and place.recording is None:
            continue
        without = last.study.with_(effects=(*effects[:k], *effects[k + 1 :]))
        other = fit_study(without, known=known.again(without))
        before = _judged(other)
        nowhere = all(after[name] >= before[name] for name in names)
        if names and (nowhere or _behind(last, other)):
            said = min(names, key=lambda name: after[name] / max(before[name], 1e-9)) if nowhere else "total"
            return {k: (before[said], after[said])}
        if place.recording is not None and spoilt(last, other):
            return {k: None}
    return {}


def _above(last: FitResult, base: FitResult) -> list[int]:
    """The number of the last finding taken in, where what would be handed over predicts the runs that chose
    nothing with a larger error than the study as it came. (A drift of a KR 300's third joint: 13 -> 11 % of
    that joint, and 37 -> 44 % of all.)"""
    return [len(last.terms) - 1] if _behind(last, base) else []


def _behind(fit: FitResult, other: FitResult) -> bool:
    """Whether it predicts the runs that chose nothing worse than the other, all channels together and channel
    by channel. (Of an LWR4+ a ripple takes joint 3 from 13.8 to 1.6 %, and the larger torques of joints 2 and
    4 from 1.0 and 1.2 to 1.4 and 1.7: the newton metres of all are more, and it is there.)"""
    return _judged(fit)["total"] > (1 + SPOILT) * _judged(other)["total"] and spoilt(fit, other)


def spoilt(fit: FitResult, other: FitResult) -> bool:
    """Whether it predicts the runs that chose nothing worse than the other, channel by channel."""
    after, before = _judged(fit), _judged(other)
    ratios = [after[name] / max(before[name], 1e-9) for name in fit.columns.channels]
    return bool(np.mean(np.log(np.maximum(ratios, 1e-9))) > SPOILT)


def _turned(last: FitResult, state: State, known: Examined, progress: Progress) -> FitResult:
    """The same with dry friction turning over as the loop found it, on the joints whose error that lowers
    on the rows that chose nothing."""
    keys = _dry_keys(state, last)
    if not keys:
        return last

    def fitted(keys: Mapping[str, tuple[float, ...]]) -> FitResult:
        turned = last.study.with_(**keys)
        return fit_study(turned, progress=progress, known=known.again(turned))

    trial = fitted(keys)
    before, after = _judged(last), _judged(trial)
    helped = np.zeros(len(next(iter(keys.values()))), bool)
    for name, channel in zip(last.columns.channels, last.columns.need.channels):
        helped[channel.joint] |= after[name] < before[name]
    if helped.all():
        return last if spoilt(trial, last) else trial
    kept = {key: tuple(v if h else 0.0 for v, h in zip(values, helped)) for key, values in keys.items()}
    kept = {key: values for key, values in kept.items() if any(values)}
    trial = fitted(kept) if kept else last
    return last if spoilt(trial, last) else trial


def turning_over(study: Study, last: FitResult) -> list[str]:
    """A note on the widths that the last fit took from the loop."""
    turns, prismatic = last.study.turn_overs, {str(j) for j in getattr(last.columns.model, "prismatic", ())}
    if turns == study.turn_overs:
        return []
    each = []
    for joint, turn in zip(last.columns.need.joints, turns):
        unit = "m" if str(joint) in prismatic else "rad"
        widths = [f"{turn.rate:.2g} {unit}/s"] * (turn.rate > 0) + [f"{turn.travel:.2g} {unit}"] * (
            turn.travel > 0
        )
        each += [f"{' and '.join(widths)} (joint {joint})"] if widths else []
    return [
        f"dry friction changes its sign within {', '.join(each)} in the model that is handed over: "
        "`turn_over` and `presliding` of the extended study"
    ]


def _dry_keys(state: State, base: FitResult) -> dict[str, tuple[float, ...]]:
    """How dry friction turns over, as keys of a study; 0: the fit's own sign. No faster than that one: the
    rows of the diagnosis leave rest out, where a sharp sign of a noisy rate is noise."""
    own = [prepare(stream, base.study.filter).vs for stream in base.recordings]
    fastest = np.max([vs for vs in own if vs is not None], axis=0) / STEEPNESS
    rates, travels = np.zeros(len(fastest)), np.zeros(len(fastest))
    for j, turn in state.turns.items():
        travels[j] = turn.travel
        if turn.travel > 0 or turn.rate > fastest[j]:
            rates[j] = max(turn.rate, fastest[j])
    out = {"turn_over": tuple(map(float, rates)), "presliding": tuple(map(float, travels))}
    return {key: values for key, values in out.items() if any(values)}


def _study_term(term: Term, state: State) -> StudyTerm:
    """A term of the loop as one of a study, its sizes and shapes as starts. Sizes that the loop left out are
    held at zero: they read what is wrong elsewhere. (Beside 45 mrad of backlash a drop of -0.2 % was fitted,
    which is impossible; beside a coupling a dry friction that spoilt the runs that chose nothing.) What no
    fitted row shows, a load on a run that judges, is held as the loop has it."""
    found = next(f for f in state.found if f.term is term)
    known = {p.name for p in term.effect.linear}
    names, bounds = term.effect.parameters_of(term.place), term.effect.bounds(term.place)
    sizes = {name: float(x) for name, x in zip(names, found.sizes) if name in known}
    left_out = dict.fromkeys(sorted({n for parts in term.effect.variants() for n in parts} - {*names}), 0.0)
    free = shown(state.rows, found.columns)
    if not free:
        left_out = dict.fromkeys((name for name in term.effect.linear_names if name not in names), 0.0)
    return StudyTerm(
        term.effect.name,
        term.effect,
        replace(term.place, parts=(*names, *left_out)),
        dict(term.theta),
        (*sizes.values(), *left_out.values()),
        tuple(bounds) if free else (),
        left_out if free else {**sizes, **left_out},
        bounds if free else {},
    )


def same(a: StudyTerm, b: Term) -> bool:
    names = ("joint", "source", "side", "recording", "link")
    return a.effect.name == b.effect.name and all(
        getattr(a.place, n) == getattr(b.place, n) for n in names if getattr(b.place, n) is not None
    )
