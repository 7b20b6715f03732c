"""The main job of the diagnosis: a study in, what its model lacks out, with the extended model fitted whole.

    study -> checks -> first fit -> rows that chose nothing (opening) -> loop -> extended study -> last fit
    -> findings

Gross faults that the examination can undo (a torque's sign, gravity) are undone first and told first, so
that no effect is made up beside them. The numbers of a finding are those of the last fit, which `ident fit`
on the extended study repeats; evidence is the loop's."""

from __future__ import annotations

import gc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from ident.cores import one_blas_thread
from ident.diagnosis.extended.approximated import moved
from ident.diagnosis.extended.by_rows_that_judge import sized_by_judged
from ident.diagnosis.extended.compared_exactly import compared_exactly, replaced
from ident.diagnosis.extended.last_fit import extended, first_extended
from ident.diagnosis.extended.on_judging_runs import spoilt
from ident.diagnosis.extended.remaining import remaining
from ident.diagnosis.extended.turning_over import turning_over
from ident.diagnosis.loop import trace
from ident.diagnosis.opening import opened
from ident.diagnosis.outcome import Outcome
from ident.diagnosis.rows.room import thrifty
from ident.diagnosis.search.candidates import Library
from ident.diagnosis.telling.beside_checks import (
    beside_faults,
    in_doubt,
    not_found,
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
from ident.diagnosis.telling.unforeseen import white_at_most
from ident.diagnosis.telling.visible import Visible, smallest_visible
from ident.errors import FitFailedError, RecordingError, StudyError
from ident.estimation.fit import FitResult, drive_gains, examined, fit_study
from ident.examination.check import Check
from ident.examination.examine import examine_tables, worst_first
from ident.examination.undone import mended_study, unsettled
from ident.progress import Progress, silent
from ident.recordings.study import Study
from modelgen.effects import catalogue
from modelgen.effects.place import Layout


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
    white_noise_percent: Mapping[str, float]
    explainable: Mapping[str, Mapping[str, float]]
    alpha: float
    notes: tuple[str, ...] = ()
    outcome: Outcome | None = field(default=None, compare=False, repr=False)
    visible: tuple[Visible, ...] = ()  # the smallest effects that would have been seen
    hints: tuple[Hint, ...] = ()  # where nothing is told: what too few blocks confirm
    unsettled: tuple[Check, ...] = ()  # faults that nothing undid: all else is told with them in it

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
    known = examined(study, progress)
    checks = worst_first([*examine_tables(known.prepared), *known.checks])
    mended = mended_study(study, checks)
    working, notes = mended or study, []
    failed: FitFailedError | None = None
    try:
        first = base = fit_study(study, progress=_part(progress, 0.0, 0.1), known=known)
    except FitFailedError as error:
        if mended is None:
            raise
        first, failed = None, error
        notes.append("as it is the study has no fit: errors before are those without its faults")
    as_it_is, against = known, ""
    if mended:
        try:
            known = examined(working)
            base = fit_study(working, progress=_part(progress, 0.1, 0.15), known=known)
        except (RecordingError, FitFailedError) as error:  # the line that a check proposes leads nowhere
            if first is None:
                raise failed or error from None
            against = f", as it leads to: {error}"
        else:
            if first is not None and spoilt(base, first):  # with effects that it declares, or at all
                against = ": the torques are predicted worse with it"
    if against and first is not None:
        notes.append(f"what the checks propose was not applied{against}")
        working, mended, base, known = study, None, first, as_it_is
    if working.drive_gains == "identify":
        try:
            working = working.with_(drive_gains=tuple(drive_gains(base)))
        except StudyError:
            raise FitFailedError(
                "drive_gains: the fit does not give every joint a positive gain; check gravity, signs and "
                "units of currents and torques, or give the gains"
            ) from None
        known = examined(working)
    begun = opened(known.prepared, _part(progress, 0.15, 0.2), memory, base.terms)
    if begun.thinned:
        notes.append("of long recordings stretches spread over them were looked at")
    library = Library(
        list(catalogue().values()),
        without_explained(begun.layout, checks),
        begun.room.library,
        frictionless(known.prepared.columns.need.joints, checks),
    )
    outcome = trace(begun.state, library, alpha, _part(progress, 0.2, 0.85))
    again, last, refused = first_extended(known, outcome, base, begun, alpha, _part(progress, 0.85, 0.95))
    outcome, last, refused = replaced(again, outcome, base, last, refused, alpha)
    no_better: list[Unexplained] = []
    while (rest := remaining(outcome, last, refused, alpha)) is not outcome:
        no_better += [u for u in not_told(outcome, refused) if u.errors is not None]
        outcome = rest
        last, refused = extended(again, outcome, base, alpha, silent)
    outcome, last, refused = compared_exactly(again, outcome, base, last, refused, alpha)
    closed = frozenset(outcome.last.model.channels[u.channel].joint for u in outcome.unnamed)
    visible = smallest_visible(outcome.last, library, outcome.tau, alpha, closed)
    found = findings_of(outcome, last, moved(known, outcome.last, base, last))
    notes += (*sized_by_judged(outcome.last, last), *turning_over(working, last))
    standing = tuple(dict.fromkeys((*unsettled(known.checks), *not_found(known.checks, found))))
    findings = told_once(
        told_by_checks(study, mended, checks), in_doubt(beside_faults(found, standing), checks)
    )
    unexplained = tuple(unexplained_of(u, outcome) for u in outcome.unnamed)
    unexplained += not_told(outcome, refused)
    told = {j for f in findings for j in f.joints} | {j for u in unexplained for j in u.joints}
    unexplained += tuple(u for u in no_better if not told.intersection(u.joints))
    unexplained += beyond_noise(last, as_told(outcome, last), findings, unexplained, outcome.tau)
    doubts = (*standing, *(check for check in checks if check.hint))
    unexplained = tuple(u for u in unexplained if not _doubted(u, doubts))
    white = white_at_most(last, outcome.last) | white_noise(last)
    in_part = tuple(f for f in findings if f.grade == PARTLY)
    floor = noise_floor(last, outcome, (*in_part, *unexplained), white)
    progress("done", 1.0)
    return Diagnosis(
        study,
        first or base,
        last,
        "effect" if findings else "unexplained" if unexplained or standing else "none",
        findings,
        unexplained,
        checks,
        floor,
        {name: min(its, floor.get(name, its)) for name, its in white.items()},
        explainable(outcome),
        alpha,
        tuple(notes),
        outcome,
        visible,
        () if findings or unexplained else tuple(hint_of(step, outcome) for step in outcome.hints),
        standing,
    )


def frictionless(joints: Sequence[object], checks: Sequence[Check]) -> frozenset[int]:
    """Places of the joints whose torques were logged less friction: what is left of it where they turn round
    is no law of theirs. (Of a UR10e's sixth a Stribeck curve that fades as it warms was told.)"""
    told = {name for check in checks if check.check == "friction_compensated" for name in check.signals}
    return frozenset(k for k, joint in enumerate(joints) if told & {f"tau_m{joint}", f"i{joint}"})


def without_explained(layout: Layout, checks: Sequence[Check]) -> Layout:
    """The places of a study without those on recordings that a check explains: what is of one recording alone
    is explained there. (Beside "in this recording tau_m2 and tau_m3 look swapped" a body of 0.35 kg m on an
    AIRBOT's second link was told.)"""
    explained = {check.recording for check in checks if check.explains and check.outcome == "warned"}
    return replace(layout, recordings=tuple(r for r in layout.recordings if r not in explained))


def _doubted(u: Unexplained, doubts: Sequence[Check]) -> bool:
    """Whether what does not carry over is of a signal that is in doubt: the check says more. (A KR 300's
    torque in N mm was called a vibration; of a Franka's torques, late in the run that judges, it was said six
    times that they differ there.)"""
    names = {f"{u.channel}{joint}" for joint in u.joints}
    return not u.carries_over and any(names & set(check.signals) for check in doubts)


def _part(progress: Progress, low: float, high: float) -> Progress:
    def tell(text: str, done: float | None = None) -> None:
        progress(text, None if done is None else low + (high - low) * done)

    return tell
