"""What a fit says of a study's effects: their reported parameters with standard deviations, as values."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ident.equations.placing import study_with
from ident.equations.terms import Term
from ident.estimation.fit import FitResult


@dataclass(frozen=True, slots=True)
class FoundParameter:
    """One reported parameter; std None where the search stopped at a bound or the value was given."""

    value: float
    std: float | None
    unit: str
    at_bound: bool
    given: bool = False


@dataclass(frozen=True, slots=True)
class FoundEffect:
    """One effect of the study as the fit has it. essential: the F-test kept it. p_value: of its sizes being
    zero, all at once, in the fit's covariance for coloured noise (Wald), its shapes as found: without
    the effect there are none, so that this is the ratio of the likelihoods, and a shape that is poorly known
    does not make the effect doubtful. p_itself: the same of those sizes without which it would be another
    effect (all, where none may be left out). p_told: of all sizes, by the standard deviations that are told:
    those of the stretches of the recordings (blocks.py). A factor's size is its logarithm here: as far from
    one are five times and a fifth. beyond: standard deviations from the nearest values that physics allows,
    where several have to agree."""

    term: Term
    joint: int | None  # as the robot file numbers it
    source_joint: int | None
    essential: bool
    parameters: dict[str, FoundParameter]
    impossible: str | None
    p_value: float = 0.0
    p_itself: float = 0.0
    p_told: float = 0.0
    beyond: float = 0.0

    def document(self) -> dict[str, Any]:
        """As fit.json has it."""
        place = self.term.place
        where: dict[str, Any] = {"side": place.side, "link": place.link, "recording": place.recording}
        where |= {"from": place.start, "to": place.stop}
        return {
            "effect": self.term.effect.name,
            "label": self.term.label,
            "joint": self.joint,
            "source_joint": self.source_joint,
            **where,
            "essential": self.essential,
            "parameters": {name: asdict(its) for name, its in self.parameters.items()},
            "impossible": self.impossible,
        }


def found_effects(result: FitResult) -> tuple[FoundEffect, ...]:
    """Every effect of a fit, in the order of the study."""
    return tuple(_found(result, term) for term in result.terms)


def extended_study(result: FitResult) -> dict[str, Any]:
    """The study's keys with its effects where the fit has them: what extended_study.yaml holds."""
    return study_with(result.study, result.terms, result.columns.need.joints)


def _found(result: FitResult, term: Term) -> FoundEffect:
    columns, effect = result.columns, term.effect
    place = {name: k for k, name in enumerate(columns.parameters)}
    own = dict(zip((*term.unknown, *term.free), (place[name] for name in term.names)))
    inner = [n for n in effect.linear_names if n in term.linear] + list(effect.nonlinear_names)
    at_bound = {n for n, k in own.items() if columns.parameters[k] in result.at_bound}
    relative = {} if result.model is None else effect.of_context(term.place, result.model.column)
    known = own | relative  # what a quantity is relative to is an estimate, too
    told_of = (*inner, *effect.context)
    covariance = np.zeros((len(told_of), len(told_of)))
    free = [i for i, name in enumerate(told_of) if name in known]
    at = [known[told_of[i]] for i in free]
    wider = np.ones(len(result.full.chi)) if result.widened is None else result.widened
    stretches = result.full_covariance * np.outer(wider, wider)
    covariance[np.ix_(free, free)] = stretches[np.ix_(at, at)]
    values = {**dict(zip(term.linear, term.size)), **term.theta}
    context = {} if result.model is None else effect.context_of(term.place, result.model)
    told = effect.report(values, covariance, context, term.place)
    joints = columns.need.joints
    joint, source = (None if j is None else joints[j] for j in (term.place.joint, term.place.source))
    sizes = [own[name] for name in (term.free if effect.changes_model else term.unknown)]
    needed = [own[name] for name in term.unknown if name in effect.needed and own[name] in sizes] or sizes
    factor = effect.factor(np.array(term.size))
    chi = result.full.chi.copy()
    if factor > 0 and factor != 1.0:  # its logarithm, whose deviation is the relative one, is told from zero
        chi[sizes] = factor * np.log(factor)
    every = list(own.values())
    reasons = [result.impossible[name] for name in term.names if name in result.impossible]
    of_sizes, of_needed, as_told = (
        _wald(chi[some], _given(spread, some, [k for k in own.values() if k not in sizes]))
        for some, spread in (
            (sizes, result.full_covariance),
            (needed, result.full_covariance),
            (sizes, stretches),
        )
    )
    return FoundEffect(
        term,
        joint,
        source,
        bool(not sizes or result.estimate.active[sizes].any()),
        {
            name: FoundParameter(
                float(its["value"]),
                float(its["std"]) if float(its["std"]) > 0 and name not in at_bound else None,
                str(its["unit"]),
                name in at_bound,
                name in inner and name not in own,
            )
            for name, its in told.items()
        },
        reasons[0] if reasons else None,
        of_sizes,
        of_needed,
        as_told,
        0.0 if result.model is None else term.beyond(stretches[np.ix_(every, every)], result.model.robot),
    )


def _given(covariance: np.ndarray, of: list[int], known: list[int]) -> np.ndarray:
    """(p, p) covariance of some parameters where others are what they are."""
    own = covariance[np.ix_(of, of)]
    known = [k for k in known if np.isfinite(covariance[k, k]) and covariance[k, k] > 0]
    if not known or not np.all(np.isfinite(own)):
        return own
    cross = covariance[np.ix_(of, known)]
    return own - cross @ np.linalg.pinv(covariance[np.ix_(known, known)], hermitian=True) @ cross.T


def _wald(sizes: np.ndarray, covariance: np.ndarray) -> float:
    """P(chi-squared) of sizes this far from zero; 0 without any that were fitted."""
    import scipy.special

    if not len(sizes) or not np.all(np.isfinite(covariance)):
        return 0.0
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(correlation)
    kept = values > 1e-10
    told = (vectors[:, kept].T @ (sizes / scale)) ** 2 / values[kept]
    return float(scipy.special.chdtrc(int(kept.sum()), told.sum()))
