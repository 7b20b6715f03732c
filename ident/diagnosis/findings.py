"""What was found and what was not, told from the loop's outcome: names, sizes, evidence, alternatives."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.stats

from ident.diagnosis.acceptance import Step, largest_drop
from ident.diagnosis.candidates import EXTENSIONS, OWN_TERMS
from ident.diagnosis.intervals import covariances, relative_to
from ident.diagnosis.loop import Outcome
from ident.diagnosis.ranking import Candidate
from ident.diagnosis.state import Found, State, refit
from ident.diagnosis.terms import Term

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


def sure_findings(outcome: Outcome) -> tuple[Outcome, tuple[Finding, ...]]:
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
    if (several or effect.context) and finding.covariance is not None:  # a share of Fv is as unsure as Fv
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


def _joints(term: Term) -> tuple[int, ...]:
    return () if term.joint is None else (term.joint + 1,)


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
    for name, item in effect.report({**theta, **values}, full, context).items():
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


def unexplained_of(outcome: Outcome) -> tuple[Unexplained, ...]:
    state = outcome.last
    out = []
    for rival in outcome.unexplained:
        name = state.context.view.channels[rival.channel]
        joint = state.context.view.joint_of[rival.channel] + 1
        share = rival.share_percent
        out.append(Unexplained((joint,), name[:5], rival.variables, share))
    return tuple(out)
