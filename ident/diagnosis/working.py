"""A study as it is diagnosed: with the lines that its checks propose, where these lead anywhere.

Gross faults that the examination can undo (a torque's sign, gravity) are undone first and told first, so that
no effect is made up beside them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ident.diagnosis.extended.on_judging_runs import spoilt
from ident.errors import FitFailedError, RecordingError, StudyError
from ident.estimation.fit import Examined, FitResult, drive_gains, examined, fit_study
from ident.examination.check import Check
from ident.examination.examine import examine_tables, worst_first
from ident.examination.undone import mended_study
from ident.progress import Progress, part_of
from ident.recordings.study import Study


@dataclass(frozen=True)
class Working:
    """study: with what was undone, drive gains as numbers; mended: it, where anything was. known: what was
    found in its recordings; checks: those of the study as it was given. before: its own fit (`base`, where it
    has none); base: the fit of `study`. notes: what was undone, or not, and why."""

    study: Study
    mended: Study | None
    known: Examined
    checks: tuple[Check, ...]
    before: FitResult
    base: FitResult
    notes: tuple[str, ...] = ()


def working_study(study: Study, progress: Progress) -> Working:
    """Raises IdentError and its relatives where neither it nor what its checks propose can be fitted."""
    known = examined(study, progress)
    checks = worst_first([*examine_tables(known.prepared), *known.checks])
    mended = mended_study(study, checks)
    try:
        first = fit_study(study, progress=part_of(progress, 0.0, 0.1), known=known)
    except FitFailedError as error:
        if mended is None:
            raise
        return _with_gains(_undone(mended, checks, error, progress))
    plain = Working(study, None, known, checks, first, first)
    return _with_gains(plain if mended is None else _better(plain, mended, progress))


def _undone(mended: Study, checks: tuple[Check, ...], failed: FitFailedError, progress: Progress) -> Working:
    """What the checks propose for a study that has no fit."""
    try:
        known, base = _fitted(mended, progress)
    except (RecordingError, FitFailedError):
        raise failed from None
    note = "as it is the study has no fit: errors before are those without its faults"
    return Working(mended, mended, known, checks, base, base, (note,))


def _better(plain: Working, mended: Study, progress: Progress) -> Working:
    """What the checks propose, where it leads to a fit that is no worse."""
    against = ": the torques are predicted worse with it"
    try:
        known, base = _fitted(mended, progress)
    except (RecordingError, FitFailedError) as error:
        against = f", as it leads to: {error}"
    else:
        if not spoilt(base, plain.base):  # with effects that it declares, or at all
            return replace(plain, study=mended, mended=mended, known=known, base=base)
    return replace(plain, notes=(f"what the checks propose was not applied{against}",))


def _fitted(mended: Study, progress: Progress) -> tuple[Examined, FitResult]:
    known = examined(mended)
    return known, fit_study(mended, progress=part_of(progress, 0.1, 0.15), known=known)


def _with_gains(its: Working) -> Working:
    """Drive gains that were identified are numbers from here on: the diagnosis asks for nothing that is
    proportional to a whole torque."""
    if its.study.drive_gains != "identify":
        return its
    try:
        study = its.study.with_(drive_gains=tuple(drive_gains(its.base)))
    except StudyError:
        raise FitFailedError(
            "drive_gains: the fit does not give every joint a positive gain; check gravity, signs and units "
            "of currents and torques, or give the gains"
        ) from None
    return replace(its, study=study, known=examined(study))
