"""The diagnosis as a value, and the way to it from a study. Pure of printing; recordings are read at the
edge.

error_percent is 100 ||rho||/||Y|| of the filtered torque. It is summed over the kept instants, 2.5 times as
many a second as the filter's cut-off in Hz: a band-limited signal sampled above its Nyquist rate keeps its
mean square, so this is the error at the full filtered rate. Joints at rest are left out, their friction is
undetermined.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.stats

from ident.diagnosis.acceptance import Step, largest_drop
from ident.diagnosis.candidates import EXTENSIONS, OWN_TERMS
from ident.diagnosis.intervals import covariances, relative_to
from ident.diagnosis.loop import Outcome, run_loop
from ident.diagnosis.model_view import build_view
from ident.diagnosis.noise_floor import noise_floor
from ident.diagnosis.ranking import Candidate
from ident.diagnosis.rows import build_rows
from ident.diagnosis.scoring import make_folds
from ident.diagnosis.state import Found, State, first_state, refit
from ident.diagnosis.terms import Term
from ident.progress import Progress, silent

Percent = dict[str, dict[str, float]]
ALTERNATIVE_SHARE = 0.3
SUREST_NOTHING = 3.0  # standard deviations that the size of a finding must be away from none


@dataclass(frozen=True)
class Rival:
    """A candidate that explains nearly the same."""

    effect: str
    joints: tuple[int, ...]
    error_drop_percent: float


@dataclass(frozen=True)
class Finding:
    """One effect that the model lacked."""

    effect: str
    joints: tuple[int, ...]
    channel: str
    parameters: dict[str, dict[str, Any]]
    p_value: float
    error_drop_percent: float  # of the worst channel, on rows that were not fitted
    gain: float
    held_out_gain: float
    alternatives: tuple[Rival, ...]
    term: Term
    covariance: np.ndarray | None = None  # of the term's linear parameters, then the nonlinear ones


@dataclass(frozen=True)
class Unexplained:
    """Structure that no known effect explains."""

    joints: tuple[int, ...]
    channel: str
    depends_on: tuple[str, ...]
    share_of_residual_percent: float


@dataclass(frozen=True)
class Diagnosis:
    """Everything that diagnosis.json, plots and the report need."""

    robot: str
    model: str
    channels: tuple[str, ...]
    verdict: str  # effect | none | unexplained
    findings: tuple[Finding, ...]
    unexplained: tuple[Unexplained, ...]
    before: Percent
    after: Percent
    noise_floor_percent: dict[str, float]
    outcome: Outcome
    study: Any = None
    notes: tuple[str, ...] = ()
    regenerated: Any = None  # a RegeneratedModel, see regenerated.with_regenerated

    def document(self) -> dict[str, Any]:
        """The content of diagnosis.json."""
        from ident.diagnosis.document import diagnosis_document

        return diagnosis_document(self)


def diagnose_study(study, progress: Progress = silent, max_terms: int | None = None) -> Diagnosis:
    """Fit, trace the residual to what the model lacks, add it, fit again. Raises IdentError and its
    relatives."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        return _diagnose(study, progress, max_terms)


def _diagnose(study, progress: Progress, max_terms: int | None) -> Diagnosis:
    import generated
    from ident.reading import need_of, open_recordings
    from modelgen.robot_file import load_robot

    progress("loading the model", 0.0)
    effects = tuple(study.effects)
    model = generated.load(study.robot_source, study.model)
    payload_models = {
        label: generated.load(study.robot_source, study.model, payload=label) for label in study.payloads
    }
    robot = load_robot(study.robot_source)
    need = need_of(study.model, tuple(model.channels), study.positions)
    progress("reading the recordings", 0.03)
    streams = open_recordings(study, need)
    recordings = joined_runs([recording for stream in streams for recording in stream.load()])
    if study.drive_gains == "identify":
        recordings = _with_identified_gains(study, recordings)
    notes = tuple(warning for stream in streams for warning in stream.warnings)
    if effects:
        notes += ("effects of the study are not in the model that is diagnosed",)
    cutoff = study.filter.position_cutoff_hz
    return diagnose_recordings(
        recordings,
        model,
        robot,
        payload_models,
        tuple(study.without),
        cutoff,
        progress,
        study,
        notes,
        max_terms,
        tuple(study.coupled_drives),
    )


@dataclass(frozen=True)
class Run:
    """A recording with its segments one after the other."""

    label: str
    role: str
    payload: str | None
    t: np.ndarray
    q: np.ndarray
    tau_m: np.ndarray | None
    tau_l: np.ndarray | None


def joined_runs(segments: Sequence) -> list[Run]:
    """Segments of one recording as one run; the gap between them stays in the time stamps."""
    labels = list(dict.fromkeys(s.label for s in segments))
    out = []
    for label in labels:
        parts = [s for s in segments if s.label == label]

        def joined(name: str, parts=parts):
            values = [getattr(p, name) for p in parts]
            return None if values[0] is None else np.concatenate(values)

        first = parts[0]
        out.append(
            Run(label, first.role, first.payload, joined("t"), joined("q"), joined("tau_m"), joined("tau_l"))
        )
    return out


def _with_identified_gains(study, recordings: list[Run]) -> list[Run]:
    """Motor signals in N m with the gains that a fit of the study identifies."""
    from ident.fit import fit_study

    result = fit_study(study.with_(reduction=False))
    gains = {name: float(v) for name, v in zip(result.columns.parameters, result.full.chi) if name[0] == "g"}
    values = np.array([gains[f"g{k + 1}"] for k in range(recordings[0].q.shape[1])])
    return [r if r.tau_m is None else replace(r, tau_m=r.tau_m * values) for r in recordings]


def diagnose_recordings(
    recordings: Sequence,
    model,
    robot,
    payload_models: dict,
    without: Sequence[str] = (),
    position_cutoff_hz: float | None = None,
    progress: Progress = silent,
    study=None,
    notes: tuple[str, ...] = (),
    max_terms: int | None = None,
    coupled_drives: Sequence[tuple[int, int]] = (),
) -> Diagnosis:
    """The loop on recordings in memory (label, role, payload, t, q, tau_m, tau_l)."""
    progress("filtering", 0.05)
    rows = build_rows(recordings, tuple(model.channels), position_cutoff_hz)
    view = build_view(model, rows.fine, robot, rows.runs, payload_models, without, coupled_drives)
    folds = make_folds(rows.run, rows.t, [r.role for r in rows.runs], [r.payload for r in rows.runs])
    first = first_state(rows, view, folds)
    outcome = run_loop(first, without, progress, **({} if max_terms is None else {"max_terms": max_terms}))
    progress("uncertainties", 0.97)
    outcome, findings = _sure(outcome)
    unexplained = _unexplained(outcome)
    verdict = "effect" if findings else ("unexplained" if unexplained else "none")
    last = outcome.last
    floor = noise_floor(last.context.rows, last.context.torque, last.system.residual)
    rows = last.context.rows
    rms = np.sqrt(np.sum((rows.y * rows.keep) ** 2, axis=1) / np.maximum(rows.keep.sum(axis=1), 1))
    return Diagnosis(
        getattr(model, "robot_name", ""),
        getattr(study, "model", getattr(model, "model", "")),
        tuple(view.channels),
        verdict,
        findings,
        unexplained,
        errors(outcome.first),
        errors(outcome.last),
        {c: float(100 * f / max(r, 1e-30)) for c, f, r in zip(view.channels, floor, rms)},
        outcome,
        study,
        notes,
    )


def errors(state: State) -> Percent:
    """{role: {"total" | channel: percent}} with everything frozen at the identify fit."""
    runs = state.context.rows.runs
    roles = [role for role in ("identify", "validate", "test") if any(r.role == role for r in runs)]
    return _percent(state, {role: [k for k, r in enumerate(runs) if r.role == role] for role in roles})


def errors_by_recording(state: State) -> Percent:
    """The same for every recording alone, {label: {"total" | channel: percent}}."""
    return _percent(state, {run.label: [k] for k, run in enumerate(state.context.rows.runs)})


def _percent(state: State, groups: Mapping[str, Sequence[int]]) -> Percent:
    rows = state.context.rows
    out: Percent = {}
    for name, runs in groups.items():
        use = np.isin(rows.run, runs) & rows.keep
        if not use.any():
            continue
        rho, y = state.system.residual * use, rows.y * use
        own = {"total": 100 * _ratio(rho, y)}
        for c, channel in enumerate(rows.channels):
            own[channel] = 100 * _ratio(rho[c], y[c])
        out[name] = own
    return out


def _ratio(rho: np.ndarray, y: np.ndarray) -> float:
    return float(np.linalg.norm(rho)) / max(float(np.linalg.norm(y)), 1e-30)


def _joints(term: Term) -> tuple[int, ...]:
    return () if term.joint is None else (term.joint + 1,)


def _sure(outcome: Outcome) -> tuple[Outcome, tuple[Finding, ...]]:
    """Findings, without those whose size may as well be nothing; the least sure goes first, the rest is
    fitted again. A term that the study itself left out stays."""
    findings = _findings(outcome)
    while True:
        fitted = {f.term.key: f.coefficients for f in outcome.last.found if f.term is not None}
        sure = {f.term.key: certainty(f, fitted[f.term.key]) for f in findings if f.effect not in OWN_TERMS}
        if not sure or min(sure.values()) >= SUREST_NOTHING:
            return outcome, findings
        worst = min(sure, key=lambda key: sure[key])
        state = refit(outcome.last, [f for f in outcome.last.found if f.term is None or f.term.key != worst])
        steps = tuple(s for s in outcome.steps if s.accepted is None or s.accepted.key != worst)
        outcome = replace(outcome, last=state, steps=steps)
        findings = _findings(outcome)


def certainty(finding: Finding, coefficients: np.ndarray) -> float:
    """Distance of the effect from nothing in standard deviations: of its one size, or of its linear
    coefficients together where it has several, which may hide behind each other (Wald)."""
    effect = finding.term.effect
    several = len(effect.size_names) > 1
    if several and effect.name in EXTENSIONS:  # flexible shapes: every part must be there
        told = [finding.parameters[name] for name in effect.size_names if name in finding.parameters]
        return min((abs(t["value"]) / t["std"] for t in told if t["std"]), default=float("inf"))
    if several and finding.covariance is not None:
        p = len(coefficients)
        C = finding.covariance[:p, :p]
        return float(np.sqrt(coefficients @ np.linalg.pinv(C) @ coefficients / p))
    nothing = 1.0 if effect.name == "drive_gain_error" else 0.0
    out = 0.0
    for name in (*effect.size_names, *effect.torque_terms):
        quantity = finding.parameters.get(name)
        if quantity is not None and quantity.get("std"):
            out = max(out, abs(quantity["value"] - nothing) / quantity["std"])
    return out if out > 0.0 else float("inf")


def _findings(outcome: Outcome) -> tuple[Finding, ...]:
    state = outcome.last
    spread = covariances(state)
    kept = {f.term.key: f for f in state.found if f.term is not None}
    out = []
    for step in outcome.steps:
        term = step.accepted
        if term is None or term.key not in kept:
            continue
        found = kept[term.key]
        assert found.term is not None
        p = len(found.term.terms) + len(found.term.effect.nonlinear)
        drop, _ = error_drop(step)
        out.append(
            Finding(
                term.effect.name,
                _joints(term),
                _channel_name(term, state),
                parameters(found, spread.get(term.key), state),
                float(scipy.stats.chi2.sf(2 * max(step.gain, 0.0), p)),
                drop,
                step.gain,
                step.held_out,
                alternatives(step),
                found.term,
                spread.get(term.key),
            )
        )
    # strongest first; terms that the study itself left out before those that no model of the paper has
    out.sort(key=lambda f: (f.effect not in OWN_TERMS, -(f.gain + f.held_out_gain)))
    return tuple(out)


def error_drop(step: Step) -> tuple[float, int]:
    """Percent by which the held-out error of the channel that gains most falls, and that channel."""
    if step.event or step.after.system.rss_held.sum() == 0:
        before, after = step.before.system.residual, step.after.system.residual
        use = step.before.system.keep & (step.before.system.folds.sets >= 0)
        a, b = np.sum((before * use) ** 2, axis=1), np.sum((after * use) ** 2, axis=1)
    else:
        a, b = step.before.system.rss_held, step.after.system.rss_held
    share, c = largest_drop(a, b)
    return 100 * share, c


def alternatives(step: Step) -> tuple[Rival, ...]:
    """Candidates of other names or places that explain a good share of what the chosen one does, on the
    channel where it does most."""
    chosen = next(
        (c for c in step.ranking if step.accepted is not None and c.term.key == step.accepted.key), None
    )
    if chosen is None:
        return ()
    own = {(chosen.term.effect.name, _joints(chosen.term))}
    before = step.before.system
    fall = np.log(before.rss / np.maximum(chosen.score.rss, 1e-30))
    main = int(np.argmax(before.count.sum(axis=0) * fall))
    out = []
    for c in sorted(step.ranking, key=lambda c: -c.total):
        place = (c.term.effect.name, _joints(c.term))
        there = np.log(before.rss[main] / np.maximum(c.score.rss[main], 1e-30))
        if place in own or c.total < ALTERNATIVE_SHARE * chosen.total or c.total <= 0:
            continue
        if not (c.event or chosen.event) and there < ALTERNATIVE_SHARE * fall[main]:
            continue  # an event's score is of other rows
        own.add(place)
        out.append(Rival(*place, _candidate_drop(c, step)))
    return tuple(out[:5])


def _candidate_drop(c: Candidate, step: Step) -> float:
    before = step.before.system.rss_held if not c.event else None
    if before is None or before.sum() == 0:
        return float(100 * (1 - np.exp(-c.total / max(step.before.system.count.sum() / 2, 1))))
    return float(100 * (1 - np.sqrt(np.min(c.score.rss_held / np.maximum(before, 1e-30)))))


def _channel_name(term: Term, state: State) -> str:
    names = [state.context.view.channels[c][:5] for c in term.channels]
    return names[-1] if term.effect.channel in ("link", "sensor") else names[0]


def parameters(found: Found, spread: np.ndarray | None, state: State) -> dict[str, dict[str, Any]]:
    """{name: {value, std, unit}} of a finding as contract 7 names them."""
    term = found.term
    assert term is not None
    effect = term.effect
    theta = effect.complete(term.theta)
    values = {name: float(a) for name, a in zip(term.terms, found.coefficients)}
    names = (*effect.linear_names, *effect.nonlinear_names, *effect.context)
    full = np.zeros((len(names), len(names)))
    if spread is not None:
        free, p = [q.name for q in term.free], len(found.coefficients)
        relative = effect.context if len(relative_to(term, state)) == len(effect.context) else ()
        place = [names.index(n) for n in (*term.terms, *free, *relative)]
        pick = [*range(len(term.terms)), *range(p, p + len(free) + len(relative))]
        full[np.ix_(place, place)] = spread[np.ix_(pick, pick)]
    if effect.name == "backlash" and term.free:  # a torque that drops shows the gap by its travel
        values["gap"] = theta["travel"]
        full[0], full[:, 0] = full[names.index("travel")], full[:, names.index("travel")]
        assert term.joint is not None
        step = np.sqrt(12.0) * state.context.rows.fine.position_noise[term.joint]
        full[0, 0] += (step / 2) ** 2  # where the gap ends is seen to half a step of the encoder
    numbers = relative_to(term, state)
    known = [float(state.context.chi[k]) for k in numbers] if numbers else [np.nan] * len(effect.context)
    context = dict(zip(effect.context, known))
    for name in effect.linear_names:
        values.setdefault(name, 0.0)
    out: dict[str, dict[str, Any]] = {}
    for name, item in effect.report(values, theta, full, context).items():
        if np.isfinite(item["value"]) and np.isfinite(item["std"]):  # type: ignore[arg-type]
            out[name] = dict(item)
    if effect.name == "joint_coupling":
        out = {k: v for k, v in out.items() if k in term.terms}
    if effect.name == "external_force" and not term.free:  # at the origin of the last frame
        out = {k: v for k, v in out.items() if k not in effect.nonlinear_names}
    if effect.name == "spring":  # a model with an offset cannot see where the spring rests
        out.pop("q0", None)
    if term.source is not None:
        out["source_joint"] = {"value": term.source + 1, "std": 0.0, "unit": ""}
    if effect.windowed:
        run = state.context.rows.runs[term.run] if term.run is not None else None
        window = term.window or (0.0, np.inf)
        start = run.start if run is not None else 0.0
        step = 0.1
        out["from"] = {"value": start + max(window[0], 0.0), "std": step if term.window else 0.0, "unit": "s"}
        if np.isfinite(window[1]):
            out["to"] = {"value": start + window[1], "std": step, "unit": "s"}
        if run is not None:
            out["recording"] = {"value": run.label, "std": 0.0, "unit": ""}
    return out


def _unexplained(outcome: Outcome) -> tuple[Unexplained, ...]:
    state = outcome.last
    out = []
    for rival in outcome.unexplained:
        name = state.context.view.channels[rival.channel]
        joint = state.context.view.joint_of[rival.channel] + 1
        share = rival.share_percent
        out.append(Unexplained((joint,), name[:5], rival.variables, share))
    return tuple(out)
