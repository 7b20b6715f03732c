"""The main job: a study in, parameters with honest uncertainties out. Pure of printing and of files written.

    study -> recordings -> [filter -> W -> decimate -> R] -> WLS -> F-statistic reduction -> errors, tests

Two passes over the recordings, whatever their length: one that folds them into factors, one that compares
the torque of the result with the measured one. A cut-off left to the Durbin-Watson rule is chosen on an
excerpt before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ident import distributions
from ident.cores import one_blas_thread
from ident.equations.build import build
from ident.equations.columns import Columns
from ident.equations.comparison import Fitted, FullRate, compare_torques
from ident.equations.fitted import FittedModel
from ident.equations.observation import RecordingSystem
from ident.equations.prepared import Prepared, prepare_study
from ident.equations.terms import Term, late_by
from ident.errors import FitFailedError, NotEnoughDataError, RecordingError, StudyError
from ident.estimation.blocks import widened
from ident.estimation.cutoff import CutoffTrial, choose_cutoff, excerpt_seconds, first_cutoff
from ident.estimation.estimators.refined import Feedback, refined
from ident.estimation.least_squares import Estimate, bounded
from ident.estimation.noise import ChannelNoise, channel_noises, durbin_watson
from ident.estimation.reduction import NormalityTest, Reduction, kolmogorov_smirnov, reduce
from ident.estimation.remarks import (
    excitation,
    implausible,
    impossible,
    payload_notes,
    payloads_in_doubt,
    resting,
)
from ident.estimation.shapes import Extended, declared, extend
from ident.estimation.solving import estimate_all
from ident.examination.check import Check, worst_first
from ident.examination.examine import examine_fit, examine_tables, sentences
from ident.examination.fits.hypothesis import signal_of
from ident.examination.tables.limits import reads_currents
from ident.examination.unseen_runs import examine_unseen
from ident.progress import Progress, silent
from ident.recordings.recording import RecordingStream
from ident.recordings.study import Study

Percent = dict[str, dict[str, float]]
LATER = 3  # times that rows are made again where a delay is another than they were made for


@dataclass(frozen=True, slots=True)
class FitResult:
    """Everything that results, plots and reports need; they compute nothing.

    estimate: the essential parameters (paper 3.4); full: all base parameters; covariance (b, b): honest, of
    the essential ones, full_covariance of all. normalised (rows,): residuals of the identify recordings
    divided by sigma_j. errors: relative errors over all samples, at both rates, and curves to draw.
    """

    study: Study
    columns: Columns
    recordings: tuple[RecordingStream, ...]
    systems: tuple[RecordingSystem, ...]
    cutoff_hz: float
    cutoff_trials: tuple[CutoffTrial, ...]
    full: Estimate
    reduction: Reduction
    estimate: Estimate
    covariance: np.ndarray
    full_covariance: np.ndarray
    noises: tuple[ChannelNoise, ...]
    durbin_watson: float
    normality: NormalityTest
    normalised: np.ndarray
    errors: FullRate
    notes: tuple[str, ...]
    checks: tuple[Check, ...]  # what was found in the data, worst first
    terms: tuple[Term, ...] = ()  # the study's effects at `estimate`
    at_bound: tuple[str, ...] = ()  # parameters that their search stopped at
    impossible: dict[str, str] = field(default_factory=dict)  # {parameter: why physics forbids its value}
    model: FittedModel | None = None  # what the effects read; None without effects
    widened: np.ndarray | None = None  # (b,) of the deviations told of effects, see blocks.py
    feedback: Feedback | None = None  # a test of "least squares is unbiased", where the loop was simulated

    @property
    def warnings(self) -> tuple[str, ...]:
        """The checks that only warn, as sentences."""
        return tuple(check.sentence for check in self.checks if check.outcome == "warned")

    @property
    def deciding(self) -> tuple[Check, ...]:
        """Its checks but those of runs that decide nothing."""
        return self.deciding_of(self.checks)

    def deciding_of(self, checks: Sequence[Check]) -> tuple[Check, ...]:
        """Of these checks those that are of no run which decides nothing."""
        unseen = {stream.label for stream in self.recordings if stream.role == "test"}
        return tuple(check for check in checks if check.recording not in unseen)

    @property
    def std(self) -> np.ndarray:
        """Honest standard deviations (b,): correlated noise, and no profit from the selection.

        They are those of the full model. A reduced model's own (`covariance`) take the cancelled parameters
        as known to be zero, which the same data only suggested: intervals from them held 87 to 91 % of the
        essential values on twins, these 92 to 96 % (benchmarks/interval_coverage.py).
        """
        return np.sqrt(np.diag(self.full_covariance))

    @property
    def relative_error(self) -> Percent:
        """At the decimated rate, {role: {"total" | channel: percent}}."""
        return self.errors.decimated.by_role()

    @property
    def full_rate_error(self) -> Percent:
        """After the position filter only."""
        return self.errors.full_rate.by_role()

    @property
    def effective_rows(self) -> float:
        return sum(noise.effective_rows for noise in self.noises)


@dataclass(frozen=True)
class Examined:
    """A study opened, and what a quick fit of it showed (examine_fit): what several fits of it share.

    unseen: what is told of runs that decide nothing (examine_unseen), beside which nothing is decided.
    systems: its equations without effects at the study's own cut-off, where they were built ahead."""

    prepared: Prepared
    checks: tuple[Check, ...]
    systems: tuple[RecordingSystem, ...] | None = None
    unseen: tuple[Check, ...] = ()

    def again(self, study: Study) -> Examined:
        """For a study with other effects, turn-over or decimation, see `Prepared.again`; what was built ahead
        serves other effects alone."""
        own = self.prepared.study
        same = study.filter == own.filter and study.turn_overs == own.turn_overs
        return replace(self, prepared=self.prepared.again(study), systems=self.systems if same else None)

    def built(self) -> Examined:
        """With its equations, for several fits that differ in their effects; the cut-off is a number."""
        return replace(
            self, systems=build(self.prepared, float(self.prepared.study.filter.decimation_cutoff_hz))
        )


def examined(study: Study, progress: Progress = silent) -> Examined:
    """Open the recordings, and hold a quick fit against physics. Raises IdentError and its relatives."""
    prepared = prepare_study(study, progress)
    declared(prepared)  # an entry that is none is told before minutes of work
    progress("examining the recordings")
    found = examine_fit(prepared)
    return Examined(prepared, found, unseen=() if found else tuple(examine_unseen(prepared)))


def fit_study(study: Study, *, progress: Progress = silent, known: Examined | None = None) -> FitResult:
    """Identify a study. Raises IdentError with one sentence, FitFailedError when no parameter comes out.

    known: of this study where it was opened before.
    """
    with one_blas_thread():
        if study.drive_gains == "identify" and not study.payload_mass:
            if study.model == "A":
                return _with_gains_of(study, "C" if study.estimator != "tls" else "D", progress)
            if study.model == "C" and study.estimator == "tls":
                return _with_gains_of(study, "D", progress)
        return _fit(known or examined(study, progress), progress)


def _with_gains_of(study: Study, model: str, progress: Progress) -> FitResult:
    """Unknown drive gains taken from another model: motor signals have no scale of their own, joint torque
    sensors give it (`tls` compares the two without the links, model D)."""
    other = study.with_(model=model, channels=None, effects=())
    try:
        gains = drive_gains(_fit(examined(other, progress), progress))
    except RecordingError as error:
        raise StudyError(
            str(study.file),
            "drive_gains",
            "with motor signals alone the scale of all torques is unknown; "
            "give payload_mass: {L: kg} of one weighed payload, or recordings with joint torques "
            f"({error})",
        ) from None
    found = {"drive_gains": tuple(gains)} | ({"estimator": "wls"} if study.estimator == "tls" else {})
    result = _fit(examined(study.with_(**found), progress), progress)
    said = f"drive gains as identified by model {model}: " + ", ".join(f"{gain:.4g}" for gain in gains)
    return replace(result, notes=(said, *result.notes))


def drive_gains(result: FitResult) -> list[float]:
    """Identified gains [N m per drive unit], one per joint; 1 of a joint whose motor's signal `channels:`
    leaves out, which nothing reads."""
    columns = result.columns
    gains = [1.0] * len(columns.need.joints)
    for channel, place in columns.gain_columns.items():
        gains[int(columns.joint_of[channel])] = float(result.estimate.chi[place])
    return gains


def _fit(known: Examined, progress: Progress) -> FitResult:
    try:
        return _fitted(known, progress)
    except (FitFailedError, NotEnoughDataError) as error:
        checks = worst_first([*examine_tables(known.prepared), *known.checks])
        if isinstance(error, NotEnoughDataError):
            causes = [check for check in checks if check.check == "frozen"]
        else:
            causes = [check for check in checks if "columns:" in check.remedy or "gravity:" in check.remedy]
        if causes:
            raise type(error)(f"{causes[0].sentence} (as it is: {error})") from None
        warned = [check for check in checks if check.outcome == "warned"]
        if not warned:
            raise
        raise type(error)(f"{error}; what was found in the data before: {warned[0].sentence}") from None


def _fitted(known: Examined, progress: Progress) -> FitResult:
    prepared, checks = known.prepared, (*known.checks, *known.unseen)
    study = prepared.study
    trials: tuple[CutoffTrial, ...] = ()
    if study.filter.decimation_cutoff_hz == "auto":
        columns = prepared.columns
        first = first_cutoff(prepared.streams, study, len(columns.parameters))
        seconds = excerpt_seconds(first, len(columns.channels), len(columns.parameters))
        progress("choosing the decimation cut-off")
        excerpts = build(prepared, first, roles=("identify",), excerpt_s=seconds)
        guess = extend(prepared, excerpts, first, progress, rough=True)
        estimate, _ = estimate_all(guess.systems, study, guess.columns, guess.allowed, guess.held)
        begin = guess.terms
        cutoff, trials = choose_cutoff(
            prepared, Fitted(guess.model, estimate.chi, guess.at(estimate.chi)), seconds, progress
        )
    else:
        begin, cutoff = declared(prepared), study.filter.decimation_cutoff_hz
    late = prepared.with_late(late_by(prepared.columns, begin))
    ahead = known.systems if late is prepared else None
    systems = ahead or build(late, cutoff, progress=progress)
    return fit_systems(late, systems, cutoff, trials, progress, begin, checks)


def fit_systems(
    prepared: Prepared,
    systems: tuple[RecordingSystem, ...],
    cutoff_hz: float,
    trials: tuple[CutoffTrial, ...] = (),
    progress: Progress = silent,
    begin: Sequence[Term] | None = None,
    checks: Sequence[Check] = (),
) -> FitResult:
    """Estimate, reduce, test and compare, from equations at one cut-off; `begin`: terms to begin with,
    `checks`: what a quick fit showed (examine_fit)."""
    study = prepared.study
    prepared, extended = _extended(prepared, systems, cutoff_hz, progress, begin)
    columns, systems = extended.columns, extended.systems
    fitted = [system for system in systems if system.role == "identify"]
    progress("least squares")
    full, _ = estimate_all(fitted, study, columns, extended.allowed, extended.held)
    its = refined(prepared, fitted, full, cutoff_hz, progress)
    full, fitted = its.estimate, list(its.observed)
    noises = channel_noises(fitted, full)
    full_covariance = its.covariance(full, noises)
    share = min(1.0, sum(noise.effective_rows for noise in noises) / full.rows)
    normalised = _normalised(fitted, full)
    used = [segment.used for system in fitted for segment in system.segments]
    normality = kolmogorov_smirnov(
        np.concatenate([rho[count] for rho, count in zip(normalised, used)]), share
    )
    reduction = _reduction(study, extended, full, share)
    estimate = extended.inside(reduction.estimate)
    estimate, at_bound = bounded(estimate) if study.bounds == "physical" else (estimate, ())
    covariance = its.covariance(estimate)
    normalised = _normalised(fitted, estimate)
    terms = extended.at(estimate.chi)
    std = np.sqrt(np.diag(full_covariance))
    notes = [
        *prepared.columns.model.notes,
        *extended.notes,
        *its.notes,
        *(note for stream in prepared.streams for note in stream.notes),
    ]
    found = [*examine_tables(prepared), *checks]
    of_one_run = {name for term in terms if term.place.recording is not None for name in term.names}
    found += excitation(full, fitted, resting(prepared), of_one_run, found)
    found += sentences("feedback", [said] if its.feedback and (said := its.feedback.sentence()) else [])
    notes += [f"{name} held at its physical bound, zero" for name in at_bound]
    notes += payload_notes(study, estimate, covariance)
    compared = compare_torques(
        prepared,
        Fitted(extended.model, estimate.chi, terms),
        Fitted(extended.model, full.chi, extended.at(full.chi)),
        cutoff_hz,
        progress,
    )
    signals = [signal_of(columns, c, reads_currents(prepared)) for c in range(len(columns.channels))]
    found += implausible(estimate, std, signals, resting(prepared), found, sorted(columns.model.prismatic))
    found += payloads_in_doubt(study, full, std)
    progress("done", 1.0)
    return FitResult(
        study,
        columns,
        prepared.streams,
        systems,
        cutoff_hz,
        trials,
        full,
        reduction,
        estimate,
        covariance,
        full_covariance,
        noises,
        durbin_watson(normalised, used),
        normality,
        np.concatenate([rho[count] for rho, count in zip(normalised, used)]),
        compared,
        tuple(notes),
        worst_first(found),
        terms,
        extended.at_bound,
        impossible(estimate, full_covariance, terms, extended.model),
        extended.model,
        widened(fitted, full, full_covariance) if extended.terms and its.plain else None,
        its.feedback,
    )


def _extended(
    prepared: Prepared,
    systems: Sequence[RecordingSystem],
    cutoff_hz: float,
    progress: Progress,
    begin: Sequence[Term] | None,
) -> tuple[Prepared, Extended]:
    """The study's effects fitted, on rows of which those samples are left out that a torque as late as it was
    found does not tell the sign of (filtering.py), and the study with such rows."""
    extended = extend(prepared, systems, cutoff_hz, progress, begin)
    for _ in range(LATER):
        late = prepared.with_late(late_by(prepared.columns, extended.terms))
        if late is prepared:
            break
        prepared = late
        systems = build(prepared, cutoff_hz, progress=progress)
        extended = extend(prepared, systems, cutoff_hz, progress, extended.terms)
    return prepared, extended


def _reduction(study: Study, extended: Extended, full: Estimate, share: float) -> Reduction:
    if not study.reduction:
        return Reduction(full, full, (), study.reduction_alpha)
    columns, groups = extended.columns, extended.groups()
    keep = frozenset(columns.parameters[k] for k in columns.gain_columns.values())
    share = share if study.effective_rows else 1.0
    return reduce(full, study.reduction_alpha, share, keep, groups)


def _normalised(systems: Sequence[RecordingSystem], estimate: Estimate) -> list[np.ndarray]:
    """Residuals over sigma_j (eq. 14), (channels, m) for each segment."""
    return [rho / estimate.sigma[:, None] for system in systems for rho in system.residuals(estimate.chi)]


def interval_factor(free: float, level: float = 0.95) -> float:
    """Half width of the two-sided interval in standard deviations (Student's t)."""
    return distributions.f_quantile(1 - level, 1, max(free, 1.0)) ** 0.5


def fit_models(study: Study, models: Sequence[str], *, progress: Progress = silent) -> dict[str, FitResult]:
    """The same recordings by several models: the paper's Table II."""
    results = {}
    for number, model in enumerate(models):

        def tell(text: str, done: float | None = None, name: str = model, n: int = number) -> None:
            progress(f"model {name}: {text}", None if done is None else (n + done) / len(models))

        needs_no_gains = model == "B" and study.drive_gains is not None
        its_study = study.with_(model=model, **({"drive_gains": None} if needs_no_gains else {}))
        results[model] = fit_study(its_study, progress=tell)
    return results
