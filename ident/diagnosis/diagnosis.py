"""The main job of the diagnosis: a study in, what its model lacks out, with the extended model fitted whole.

    study -> checks -> first fit (working) -> rows that chose nothing (opening) -> loop -> extended study
    -> last fit (traced) -> findings

The numbers of a finding are those of the last fit, which `ident fit` on the extended study repeats; evidence
is the loop's."""

from __future__ import annotations

import gc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from ident.cores import one_blas_thread
from ident.diagnosis.extended.approximated import moved
from ident.diagnosis.extended.by_rows_that_judge import sized_by_judged
from ident.diagnosis.extended.turning_over import turning_over
from ident.diagnosis.extended.unanswered import unanswered
from ident.diagnosis.opening import opened
from ident.diagnosis.outcome import Outcome
from ident.diagnosis.rows.room import thrifty
from ident.diagnosis.search.candidates import Library
from ident.diagnosis.search.searched import searched
from ident.diagnosis.telling.beside_checks import (
    assumed,
    beside_doubts,
    beside_faults,
    in_doubt,
    not_found,
    of_fitted,
    told_by_checks,
    told_once,
)
from ident.diagnosis.telling.beyond_noise import beyond_noise
from ident.diagnosis.telling.findings import (
    PARTLY,
    Finding,
    Hint,
    Unexplained,
    as_told,
    explainable,
    findings_of,
    hint_of,
    not_told,
    unexplained_of,
)
from ident.diagnosis.telling.floor import noise_floor, white_noise
from ident.diagnosis.telling.multiples import multiples
from ident.diagnosis.telling.unforeseen import white_at_most
from ident.diagnosis.telling.visible import Visible, smallest_visible
from ident.diagnosis.traced import Traced, trace_whole
from ident.diagnosis.working import Working, working_study
from ident.estimation.fit import FitResult
from ident.examination.check import Check, worst_first
from ident.examination.undone import unsettled
from ident.progress import Progress, part_of, silent
from ident.recordings.study import Study


@dataclass(frozen=True)
class Diagnosis:
    """first, last: the study's fit and the extended study's; undone: the first without the faults that
    checks undid, where there were any. Report and document read this and compute nothing."""

    study: Study
    first: FitResult
    last: FitResult
    verdict: str  # effect | none | unexplained
    findings: tuple[Finding, ...]
    unexplained: tuple[Unexplained, ...]
    checks: tuple[Check, ...]
    noise_floor_percent: Mapping[str, float]
    white_noise_percent: Mapping[str, float]
    explainable: Mapping[str, Mapping[str, float]]
    alpha: float
    notes: tuple[str, ...] = ()
    outcome: Outcome | None = field(default=None, compare=False, repr=False)
    visible: tuple[Visible, ...] = ()  # the smallest effects that would have been seen
    hints: tuple[Hint, ...] = ()  # where nothing is told: what too few blocks confirm
    unsettled: tuple[Check, ...] = ()  # faults that nothing undid: all else is told with them in it
    assumed: tuple[Check, ...] = ()  # of several causes the first, undone: all else is told with that
    unanswered: tuple[Check, ...] = ()  # what was found explains less than half of these
    undone: FitResult | None = None
    repeats: tuple[str, ...] = ()  # findings that are one thing which repeats with a position, in a sentence

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
    gc.freeze()  # what is imported is not searched again for garbage whenever memory is given back
    try:
        with one_blas_thread():
            return _diagnose(study, thrifty(progress), study.alpha if alpha is None else alpha, memory)
    finally:
        gc.unfreeze()


def _diagnose(study: Study, progress: Progress, alpha: float, memory: float | None) -> Diagnosis:
    its = working_study(study, progress)
    begun = opened(its.known.prepared, part_of(progress, 0.15, 0.2), memory, its.base.terms)
    library = searched(begun.layout, begun.room.library, its.known.prepared.columns.need.joints, its.checks)
    traced = trace_whole(its, begun, library, alpha, part_of(progress, 0.2, 0.95))
    thinned = ("of long recordings stretches spread over them were looked at",) if begun.thinned else ()
    told = _told(study, its, traced, library, alpha)
    progress("done", 1.0)
    return replace(told, notes=(*its.notes, *thinned, *told.notes))


def _told(study: Study, its: Working, traced: Traced, library: Library, alpha: float) -> Diagnosis:
    """What is said of what was traced, beside what the checks say."""
    outcome, last = traced.outcome, traced.last
    found = findings_of(outcome, last, moved(its.known, outcome.last, its.base, last))
    left = not_found(its.base.deciding_of(its.checks), found)
    standing = tuple(dict.fromkeys((*unsettled(its.base.deciding), *left)))
    taken = assumed(its.checks)
    errors = (fit.errors.full_rate.by_recording() for fit in (its.base, last))
    doubts = unanswered(its.base.deciding, *errors)
    fitted = [entry.label for entry in study.recordings if entry.use == "identify"]
    found = beside_doubts(beside_faults(found, (*standing, *taken)), doubts, fitted)
    findings = told_once(told_by_checks(study, its.mended, its.checks), in_doubt(found, its.checks))
    unexplained = _unexplained(its.checks, traced, findings, standing, doubts, fitted)
    white = white_at_most(last, outcome.last) | white_noise(last)
    in_part = tuple(f for f in findings if f.grade == PARTLY)
    floor = noise_floor(last, outcome, (*in_part, *unexplained), white)
    closed = frozenset(outcome.last.model.channels[u.channel].joint for u in outcome.unnamed)
    return Diagnosis(
        study,
        its.before,
        last,
        "effect" if findings else "unexplained" if unexplained or standing or taken or doubts else "none",
        findings,
        unexplained,
        worst_first([*its.checks, *its.known.unseen, *(c for c in last.checks if c.check == "payload_mass")]),
        floor,
        {name: min(its, floor.get(name, its)) for name, its in white.items()},
        explainable(outcome),
        alpha,
        (*sized_by_judged(outcome.last, last), *turning_over(its.study, last)),
        outcome,
        smallest_visible(outcome.last, library, outcome.tau, alpha, closed),
        () if findings or unexplained else tuple(hint_of(step, outcome) for step in outcome.hints),
        standing,
        taken,
        doubts,
        None if its.base is its.before else its.base,
        tuple(multiples(findings, alpha)),
    )


def _unexplained(
    checks: Sequence[Check],
    traced: Traced,
    findings: Sequence[Finding],
    standing: Sequence[Check],
    doubts: Sequence[Check],
    fitted: Sequence[str],
) -> tuple[Unexplained, ...]:
    """What is found to be there and has no name, beside what is told, but for signals in doubt. What no more
    than stands out beside a fault, or torques in doubt of a run that is fitted, may be its shadow: the
    parameters of all torques answer to it. (Of a rokae whose fifth torque was turned in the fitted run it was
    said that something happened to the fourth for half a second.)"""
    outcome, last = traced.outcome, traced.last
    out = tuple(unexplained_of(u, outcome) for u in outcome.unnamed)
    out += not_told(outcome, traced.refused)
    told = {j for f in findings for j in f.joints} | {j for u in out for j in u.joints}
    out += tuple(u for u in traced.no_better if not told.intersection(u.joints))
    if not standing and not of_fitted(doubts, fitted):
        out += beyond_noise(last, as_told(outcome, last), findings, out, outcome.tau)
    standing = (*standing, *(check for check in checks if check.hint))
    return tuple(u for u in out if not _doubted(u, standing if _of_signals(u) else (*standing, *doubts)))


def _of_signals(u: Unexplained) -> bool:
    """Whether it says more than a check that its torque is not as it should be. (Of an AIRBOT's, in one run
    without gravity, three were told to oscillate.)"""
    return bool(u.depends_on) and u.oscillates_hz is None


def _doubted(u: Unexplained, doubts: Sequence[Check]) -> bool:
    """Whether what does not carry over is of a signal that is in doubt: the check says more. (A KR 300's
    torque in N mm was called a vibration; of a Franka's torques, late in the run that judges, it was said six
    times that they differ there.)"""
    names = {f"{u.channel}{joint}" for joint in u.joints}
    return not u.carries_over and any(names & set(check.signals) for check in doubts)
