"""The main job of the diagnosis: a study in, what its model lacks out, with the extended model fitted whole.

    study -> checks -> first fit -> rows that chose nothing (opening) -> loop -> extended study -> last fit
    -> findings

Gross faults that the examination can undo (a torque's sign, gravity) are undone first and told first, so
that no effect is made up beside them. The numbers of a finding are those of the last fit, which `ident fit`
on the extended study repeats; evidence is the loop's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ident.diagnosis.candidates import Library
from ident.diagnosis.floor import noise_floor
from ident.diagnosis.loop import BUDGET, Outcome, Step, Unnamed, swapped, trace
from ident.diagnosis.opening import Opened, opened
from ident.diagnosis.pictures import Picture, picture
from ident.diagnosis.room import thrifty
from ident.diagnosis.seconds_apart import seconds_apart
from ident.diagnosis.settling import place_of
from ident.diagnosis.state import State, without
from ident.diagnosis.sufficiency import explained_share, signals_read
from ident.diagnosis.terms import Term
from ident.diagnosis.visible import Visible, smallest_visible
from ident.diagnosis.weighing import Equivalent
from ident.equations.placing import entry_of
from ident.equations.terms import Term as StudyTerm
from ident.errors import FitFailedError, NotEnoughDataError, StudyError
from ident.estimation.fit import Examined, FitResult, drive_gains, examined, fit_study
from ident.estimation.found_effects import FoundEffect, found_effects
from ident.examination.check import Check
from ident.examination.examine import examine_tables, mended_study, worst_first
from ident.progress import Progress, silent
from ident.recordings.study import Study
from ident.signals.filtering import STEEPNESS, prepare
from modelgen.effects import catalogue

FAR_OFF = 3.0  # times what noise and parameters explain: an error of judged rows that is no noise
OWN_COURSE = 5.0  # times what is new from row to row: an error that its past foretells is no drive's noise
SPOILT = 0.02  # of the error of the runs that chose nothing: more is no rounding
ESTABLISHED, PARTLY = "established", "partly"


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another explanation of a finding. equivalent: these data cannot reject it."""

    effect: str
    joints: tuple[int, ...]
    log_e: float
    error_drop_percent: float
    source_joint: int | None = None  # of a pair of joints, the other one
    link: int | None = None
    seconds: float | None = None  # of motion as it is until the two are told apart


@dataclass(frozen=True, slots=True)
class Finding:
    """One effect that the model lacked; parameters {name: {value, std, unit, at_bound}} of the last fit."""

    effect: str
    joints: tuple[int, ...]
    channel: str
    where: Mapping[str, Any]  # side, recording, from, to, source_joint, link
    parameters: Mapping[str, Mapping[str, Any]]
    p_value: float
    log_e: float
    gain: float
    error_drop_percent: float  # of its channel, whitened, on rows that chose nothing
    equivalent: tuple[Alternative, ...]
    remedy: str
    grade: str
    signature: str
    picture: Picture | None = None


@dataclass(frozen=True, slots=True)
class Unexplained:
    """Structure that no known effect explains; share of what the model leaves of the channel's torque."""

    joints: tuple[int, ...]
    channel: str
    depends_on: tuple[str, ...]
    share_of_residual_percent: float
    log_e: float
    nearest: Alternative | None
    carries_over: bool
    picture: Picture | None = None


@dataclass(frozen=True)
class Diagnosis:
    """first, last: the study's fit and the extended study's. Report and document read this and compute
    nothing."""

    study: Study
    first: FitResult
    last: FitResult
    verdict: str  # effect | none | unexplained
    findings: tuple[Finding, ...]
    unexplained: tuple[Unexplained, ...]
    checks: tuple[Check, ...]
    noise_floor_percent: Mapping[str, float]
    explainable: Mapping[str, Mapping[str, float]]
    alpha: float
    notes: tuple[str, ...] = ()
    outcome: Outcome | None = field(default=None, compare=False, repr=False)
    visible: tuple[Visible, ...] = ()  # the smallest effects that would have been seen

    @property
    def robot(self) -> str:
        return str(self.first.columns.model.robot_name)

    @property
    def model(self) -> str:
        return self.study.model

    @property
    def channels(self) -> tuple[str, ...]:
        return self.first.columns.channels

    @property
    def extended(self) -> Study:
        return self.last.study


def diagnose_study(
    study: Study, progress: Progress = silent, alpha: float | None = None, memory: float | None = None
) -> Diagnosis:
    """Fit, trace the residual to what the model lacks, add it, fit again. Raises IdentError and its
    relatives.

    alpha: rate of false findings in the whole study (the study's own where not given). memory [bytes]: what
    the process may take (half of what is free where not given).
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        return _diagnose(study, thrifty(progress), study.alpha if alpha is None else alpha, memory)


def _diagnose(study: Study, progress: Progress, alpha: float, memory: float | None) -> Diagnosis:
    known = examined(study, progress)
    checks = worst_first([*examine_tables(known.prepared), *known.checks])
    mended = mended_study(study, checks)
    first = base = fit_study(study, progress=_part(progress, 0.0, 0.1), known=known)
    working = mended or study
    if mended:
        known = examined(working)
        base = fit_study(working, progress=_part(progress, 0.1, 0.15), known=known)
    if working.drive_gains == "identify":
        working = working.with_(drive_gains=tuple(drive_gains(base)))
        known = examined(working)
    begun = opened(known.prepared, _part(progress, 0.15, 0.2), memory)
    library = Library(list(catalogue().values()), begun.layout, begun.room.library)
    outcome = trace(begun.state, library, alpha, _part(progress, 0.2, 0.85))
    closed = frozenset(outcome.last.model.channels[u.channel].joint for u in outcome.unnamed)
    visible = smallest_visible(outcome.last, library, outcome.tau, alpha, closed)
    last, refused = _extended(known, outcome, base, begun, alpha, _part(progress, 0.85, 0.97))
    outcome, last, refused = _replaced(known, outcome, base, last, refused, begun, alpha)
    outcome, last = _exactly(known, outcome, base, last, begun, alpha)
    findings = (*_told_by_checks(study, mended, checks), *_findings(outcome, last, begun, alpha))
    unexplained = tuple(_unexplained(u, outcome, begun) for u in outcome.unnamed)
    unexplained += tuple(_not_fitted(step, outcome) for step in outcome.steps if step.term.key in refused)
    unexplained += _beyond_noise(last, _as_told(outcome, last), findings, unexplained)
    progress("done", 1.0)
    return Diagnosis(
        study,
        first,
        last,
        "effect" if findings else "unexplained" if unexplained else "none",
        findings,
        unexplained,
        checks,
        noise_floor(last),
        _explainable(outcome, begun),
        alpha,
        ("of long recordings stretches spread over them were looked at",) if begun.thinned else (),
        outcome,
        visible,
    )


def _part(progress: Progress, low: float, high: float) -> Progress:
    def tell(text: str, done: float | None = None) -> None:
        progress(text, None if done is None else low + (high - low) * done)

    return tell


def _extended(
    known: Examined, outcome: Outcome, base: FitResult, begun: Opened, alpha: float, progress: Progress
) -> tuple[FitResult, set[tuple]]:
    """The study with the findings as its effects, fitted whole; without those that it does not need, and
    those that cannot be fitted there, whose keys are told."""
    refused: set[tuple] = set()
    study = known.prepared.study
    declared = len(study.effects)
    terms = outcome.last.terms[declared:]
    if not terms:
        return base, refused
    joints = base.columns.need.joints
    settings = study.filter.model_copy(
        update={
            "decimation_cutoff_hz": max(
                base.cutoff_hz, min(0.5 * study.filter.position_cutoff_hz, begun.cutoff_hz)
            )
        }
    )
    limit = alpha / BUDGET
    entries = [*study.effects, *(entry_of(_study_term(t, outcome.last), joints) for t in terms)]
    keys = [*(() for _ in study.effects), *(t.key for t in terms)]
    while len(entries) > declared:
        extended = study.with_(effects=tuple(entries), filter=settings)
        try:
            last = fit_study(extended, progress=progress, known=known.again(extended))
        except (FitFailedError, NotEnoughDataError, StudyError):
            entries.pop()
            refused.add(keys.pop())
            continue
        told = found_effects(last)
        impossible = [k for k, f in enumerate(told) if k >= declared and not _possible(f.term)]
        if impossible:
            at = max(impossible, key=lambda k: told[k].p_value)
            refused.add(keys.pop(at))
            entries.pop(at)
            continue
        weak = [k for k, f in enumerate(told) if k >= declared and not (f.essential and f.p_value < limit)]
        weakest = max(weak, key=lambda k: (not told[k].essential, told[k].p_value), default=None)
        lost = _worse(last, base, declared) if weakest is None else [weakest]  # two can hide each other
        if not lost:
            return _turned(last, outcome.last, known, progress), refused
        entries = [entry for k, entry in enumerate(entries) if k not in lost]
        keys = [key for k, key in enumerate(keys) if k not in lost]
    return base, refused


def _replaced(
    known: Examined,
    outcome: Outcome,
    base: FitResult,
    last: FitResult,
    refused: set[tuple],
    begun: Opened,
    alpha: float,
) -> tuple[Outcome, FitResult, set[tuple]]:
    """In the place of what the last fit could not be made of, what was as likely in the loop."""
    for at, step in enumerate(outcome.steps):
        for rival in step.equivalent if step.term.key in refused else ():
            other = swapped(outcome, at, rival.term)
            if other is outcome:
                continue
            fit, still = _extended(known, other, base, begun, alpha, silent)
            if _is_told(fit, rival.term):
                left = tuple(e for e in step.equivalent if e is not rival)
                outcome = other.with_step(at, replace(other.steps[at], equivalent=left))
                last, refused = fit, still
                break
    return outcome, last, refused


def _exactly(
    known: Examined, outcome: Outcome, base: FitResult, last: FitResult, begun: Opened, alpha: float
) -> tuple[Outcome, FitResult]:
    """Explanations that act on the model's own torque (a delay, a lag, a soft gear) compared by their last
    fits: in the loop their columns are made with the model that stood beside them, which favours the one
    that it was settled with. Those that the best one on the rows that chose nothing is not ahead of by the
    limit cannot be told apart: the simplest is told, and the others beside it."""
    for at, step in enumerate(outcome.steps):
        rivals = [t for t in step.passed if t.size is not None and t.key != step.term.key]
        if step.term.size is None or not rivals or not _is_told(last, step.term):
            continue
        tried = [(outcome, last)]
        for rival in rivals:
            other = swapped(outcome, at, rival)
            if other is outcome:
                continue
            fit, _ = _extended(known, other, base, begun, alpha, silent)
            if _is_told(fit, rival):
                tried.append((other, fit))
        nats = [_nats(begun.state, fit) for _, fit in tried]
        equal = [k for k, n in enumerate(nats) if n > max(nats) - outcome.tau]
        best = min(equal, key=lambda k: (_free(tried[k][0].steps[at].term), -nats[k]))
        own = step.evidence.log_e
        told = tuple(
            Equivalent(tried[k][0].steps[at].term, own + nats[k] - nats[best]) for k in equal if k != best
        )
        keys = {t[0].steps[at].term.key for t in tried}
        others = tuple(e for e in step.equivalent if e.term.key not in keys)
        outcome, last = tried[best]
        outcome = outcome.with_step(at, replace(outcome.steps[at], equivalent=(*told, *others)))
    return outcome, last


def _free(term: Term) -> tuple[int, bool]:
    return term.free, not term.effect.common


def _is_told(fit: FitResult, term: Term) -> bool:
    return any(_same(told, term) for told in fit.terms)


def _nats(state: State, fit: FitResult) -> float:
    """Of the error of the runs that chose nothing, as if each row were news."""
    error = _judged(fit)
    counts = [int((use & state.rows.judged).sum()) for use in state.rows.use]
    return -float(sum(n * np.log(error[name]) for n, name in zip(counts, fit.columns.channels)))


def _possible(term: StudyTerm) -> bool:
    """Whether physics allows the values of the fit."""
    return term.effect.physical({**dict(zip(term.linear, term.size)), **term.theta}) is None


def _judged(fit: FitResult) -> Mapping[str, float]:
    """Percent of the runs that chose nothing, where there are such."""
    return fit.full_rate_error.get("validate") or fit.full_rate_error["identify"]


def _worse(last: FitResult, base: FitResult, declared: int) -> list[int]:
    """The last finding taken in with which the model predicts none of its channels better than without, or,
    of a load on one recording, with which it predicts the others worse: as `ident fit` does it, it explains
    nothing."""
    after, before = _judged(last), _judged(base)
    channels = last.columns.need.channels
    for k in range(len(last.terms) - 1, declared - 1, -1):
        place = last.terms[k].place
        names = [last.columns.channels[c] for c in place.rows(channels)] if place.recording is None else []
        if names and all(after[name] >= before[name] for name in names):
            return [k]
        if place.recording is not None and _spoilt(last, base):
            return [k]
    return []


def _spoilt(fit: FitResult, other: FitResult) -> bool:
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
        return last if _spoilt(trial, last) else trial
    kept = {key: tuple(v if h else 0.0 for v, h in zip(values, helped)) for key, values in keys.items()}
    kept = {key: values for key, values in kept.items() if any(values)}
    trial = fitted(kept) if kept else last
    return last if _spoilt(trial, last) else trial


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
    """A term of the loop as one of a study, its sizes and shapes as starts."""
    found = next(f for f in state.found if f.term is term)
    known = {p.name for p in term.effect.linear}
    names = term.effect.parameters_of(term.place)
    sizes = tuple(float(x) for name, x in zip(names, found.sizes) if name in known)
    return StudyTerm(
        term.effect.name,
        term.effect,
        term.place,
        dict(term.theta),
        sizes,
        tuple(term.effect.nonlinear_names),
        {},
        term.effect.bounds(term.place),
    )


def _joints(term: Term, state: State) -> tuple[int, ...]:
    labels = state.problem.robot.joint_labels
    return () if term.place.joint is None else (int(labels[term.place.joint]),)


def _channel(c: int, state: State) -> str:
    return state.model.channels[c].name(state.problem.robot.joint_labels)


def _side(c: int, state: State) -> str:
    return _channel(c, state).rstrip("0123456789")


def _findings(outcome: Outcome, last: FitResult, begun: Opened, alpha: float) -> tuple[Finding, ...]:
    state = outcome.last
    told = list(found_effects(last)) if last.terms else []
    out = []
    for step in sorted(outcome.steps, key=lambda s: -s.evidence.log_e):
        term = next((t for t in state.terms if t.key == step.term.key), None)
        fitted = next((f for f in told if term is not None and _same(f.term, term)), None)
        if term is not None and fitted is not None:
            told.remove(fitted)  # one that grew by more of its parameters is one finding
            out.append(_finding(step, term, fitted, outcome))
    return tuple(out)


def _same(a: StudyTerm, b: Term) -> bool:
    names = ("joint", "source", "side", "recording", "link")
    return a.effect.name == b.effect.name and all(
        getattr(a.place, n) == getattr(b.place, n) for n in names if getattr(b.place, n) is not None
    )


def _finding(step: Step, term: Term, fitted: FoundEffect, outcome: Outcome) -> Finding:
    state, e = outcome.last, step.evidence
    place = term.place
    c = max(range(len(e.per_channel)), key=lambda k: e.per_channel[k])
    labels = state.problem.robot.joint_labels
    where = {
        "side": place.side,
        "source_joint": None if place.source is None else int(labels[place.source]),
        "recording": place.recording,
        "from": place.start,
        "to": place.stop,
        "link": place.link,
    }
    left = {u.channel for u in outcome.unnamed}
    own = set(place.rows(state.model.channels))
    partly = place.joint is not None and bool(left & own)
    drop = 100 * (1 - np.exp(-e.per_channel[c] / max(state.metric.judged.free[c], 1.0)))
    return Finding(
        term.effect.name,
        _joints(term, state),
        _side(c, state),
        {key: value for key, value in where.items() if value is not None},
        {
            name: {"value": p.value, "std": p.std, "unit": p.unit, "at_bound": p.at_bound}
            for name, p in fitted.parameters.items()
        },
        float(min(1.0, np.exp(-e.log_e) * BUDGET)),
        float(e.log_e),
        float(e.gain),
        float(drop),
        tuple(
            Alternative(
                eq.term.effect.name,
                _joints(eq.term, state),
                float(eq.log_e),
                float(100 * (1 - np.exp(-eq.log_e / max(state.metric.judged.free[c], 1.0)))),
                None if eq.term.place.source is None else int(labels[eq.term.place.source]),
                eq.term.place.link,
                seconds_apart(state, term, eq.term, outcome.tau),
            )
            for eq in step.equivalent
        ),
        term.effect.remedy,
        PARTLY if partly else ESTABLISHED,
        term.effect.signature,
        picture(state, term, c),
    )


def _unexplained(u: Unnamed, outcome: Outcome, begun: Opened) -> Unexplained:
    state = outcome.last
    joint = int(state.problem.robot.joint_labels[state.model.channels[u.channel].joint])
    name = _channel(u.channel, state)
    near = u.nearest
    return Unexplained(
        (joint,),
        _side(u.channel, state),
        tuple(dict.fromkeys(_signal(v, name) for v in u.variables)),
        100 * u.share,
        u.log_e,
        None
        if near is None
        else Alternative(near.term.effect.name, _joints(near.term, state), float(near.log_e), 0.0),
        u.carries_over,
        picture(state, None, u.channel, u.variables),
    )


def _as_told(outcome: Outcome, last: FitResult) -> State:
    """The loop's state with what is handed over alone."""
    state = outcome.last
    for f in outcome.last.found:
        if f.term is not None and not _is_told(last, f.term):
            at = place_of(state, f.term)
            state = state if at is None else without(state, at)
    return state


def _not_fitted(step: Step, outcome: Outcome) -> Unexplained:
    """What the loop found and the last fit could not be made of."""
    state, e, term = outcome.last, step.evidence, step.term
    c = max(range(len(e.per_channel)), key=lambda k: e.per_channel[k])
    joint = int(state.problem.robot.joint_labels[state.model.channels[c].joint])
    number, share = place_of(state, term), 0.0
    if number is not None and c in state.found[number].columns:
        f = state.found[number]
        share = 100 * explained_share(state.but(number), c, f.columns[c] @ f.sizes)
    near = Alternative(term.effect.name, _joints(term, state), float(e.log_e), 0.0)
    name = _channel(c, state)
    signals = tuple(dict.fromkeys(_signal(v, name) for v in sorted(signals_read(term) or ())))
    shown = picture(state, term, c)
    return Unexplained((joint,), _side(c, state), signals, share, float(e.log_e), near, True, shown)


def _beyond_noise(
    last: FitResult, state: State, findings: Sequence[Finding], told: Sequence[Unexplained]
) -> tuple[Unexplained, ...]:
    """Channels of which nothing was said, and whose residual is no noise all the same: its error on the rows
    that judge is far beyond what noise and the parameters' uncertainty make there, or it goes its own way in
    time, foretold by its own past (a vibration, a slosh, a drift)."""
    known = {joint for f in findings for joint in f.joints} | {joint for u in told for joint in u.joints}
    everywhere = any(not f.joints for f in findings)
    rows, out = state.rows, []
    for c, channel in enumerate(last.columns.need.channels):
        joint = last.columns.need.joints[channel.joint]
        fitted, judged = (side & rows.use[c] for side in (rows.fitted, rows.judged))
        if joint in known or everywhere or not fitted.any() or not judged.any():
            continue
        noise = np.mean(state.residual[c, fitted] ** 2)
        expected = noise + np.mean(_parameter_variance(last, state, c, judged))
        found = np.mean(state.residual[c, judged] ** 2)
        new = state.whiteners[c].sigma ** 2
        kind = last.columns.channels[c].rstrip("0123456789")
        if found > FAR_OFF**2 * expected:
            share = 100.0 * float(1.0 - expected / found)
            out.append(Unexplained((joint,), kind, (), share, 0.0, None, False))
        elif noise > OWN_COURSE**2 * new:
            nats = 0.5 * float(fitted.sum()) * float(np.log(noise / new))
            share = 100.0 * float(1.0 - new / noise)
            shown = picture(state, None, c, ("t",))
            out.append(Unexplained((joint,), kind, ("t",), share, nats, None, False, shown))
    return tuple(out)


def _parameter_variance(last: FitResult, state: State, c: int, where: np.ndarray) -> np.ndarray:
    """(rows,) variance of a channel's model torque from the fit's covariance for coloured noise."""
    places, values = state.rows.base[c]
    mine = places < len(last.full_covariance)
    X, C = values[where][:, mine], last.full_covariance[np.ix_(places[mine], places[mine])]
    return np.asarray(np.einsum("ij,jk,ik->i", X, C, X))


def _signal(variable: str, channel: str) -> str:
    return channel if variable == "tau" else variable


def _told_by_checks(study: Study, mended: Study | None, checks: Sequence[Check]) -> tuple[Finding, ...]:
    """Faults that the examination undid, as findings: the effect that declares to be told by such a check."""
    if mended is None:
        return ()
    by_check = {name: e for e in catalogue().values() for name in e.told_by}
    out = []
    for check in checks:
        effect = by_check.get(check.check)
        if effect is None:
            continue
        values: dict[str, dict[str, Any]] = {}
        if mended.gravity is not None and mended.gravity != study.gravity and not check.signals:
            values = {
                f"g{axis}": {"value": float(g), "std": None, "unit": "m/s^2", "at_bound": False}
                for axis, g in zip("xyz", mended.gravity)
            }
        joints = tuple(int("".join(filter(str.isdigit, name)) or 0) for name in check.signals)
        side = "tau_l" if any(name.startswith("tau_l") for name in check.signals) else "tau_m"
        out.append(
            Finding(
                effect.name, joints, side, {}, values, 0.0, float("inf"), float("inf"), 0.0, (),
                check.remedy or effect.remedy, ESTABLISHED, check.message,
            )
        )  # fmt: skip
    return tuple(out)


def _explainable(outcome: Outcome, begun: Opened) -> dict[str, dict[str, float]]:
    """Per channel: nats that names explain of what names and functions without a name do together."""
    state = outcome.last
    named, nameless = np.zeros(state.rows.channels), np.zeros(state.rows.channels)
    for step in outcome.steps:
        place = step.term.place
        own = range(len(named)) if place.joint is None else place.rows(state.model.channels)
        for c in own:
            named[c] += max(float(step.evidence.per_channel[c]), 0.0)
    for u in outcome.unnamed:
        nameless[u.channel] += max(u.log_e, 0.0)
    out = {}
    for c in range(state.rows.channels):
        whole = float(named[c] + nameless[c])
        share = 100.0 * float(named[c]) / whole if whole > 0 else 100.0
        out[_channel(c, state)] = {"explainable_nats": whole, "explained_share_percent": share}
    return out
