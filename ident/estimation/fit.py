"""The main job: a study in, parameters with honest uncertainties out. Pure of printing and of files written.

    study -> recordings -> [filter -> W -> decimate -> R] -> WLS -> F-statistic reduction -> errors, tests

Two passes over the recordings, whatever their length: one that folds them into factors, one that compares
the torque of the result with the measured one. A cut-off left to the Durbin-Watson rule is chosen on an
excerpt before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.special

from ident.equations.build import build
from ident.equations.columns import Columns
from ident.equations.comparison import FullRate, compare_torques
from ident.equations.observation import ChannelFactor, RecordingSystem, stack
from ident.equations.prepared import Prepared, prepare_study
from ident.equations.suspicions import BAD_PERCENT, suspected_mix_ups
from ident.errors import FitFailedError, RecordingError, StudyError
from ident.estimation.cutoff import CutoffTrial, choose_cutoff, excerpt_seconds, first_cutoff
from ident.estimation.gains import estimate_with_gains
from ident.estimation.least_squares import (
    Estimate,
    bounded,
    channel_sigma,
    huber_factors,
    weighted_least_squares,
)
from ident.estimation.noise import ChannelNoise, channel_noises, durbin_watson, honest_covariance
from ident.estimation.reduction import NormalityTest, Reduction, kolmogorov_smirnov, reduce
from ident.progress import Progress, silent
from ident.recordings.recording import RecordingStream
from ident.recordings.study import Study

Percent = dict[str, dict[str, float]]


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
    warnings: tuple[str, ...]

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


def fit_study(study: Study, *, progress: Progress = silent) -> FitResult:
    """Identify a study. Raises IdentError with one sentence, FitFailedError when no parameter comes out.

    BLAS runs on one thread: the matrices are small, and several processes share a machine better so.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        if study.model == "A" and study.drive_gains == "identify" and not study.payload_mass:
            return _with_gains_of_c(study, progress)
        return _fit(study, progress)


def _with_gains_of_c(study: Study, progress: Progress) -> FitResult:
    """Model A with unknown drive gains: motor signals have no scale of their own, joint torque sensors give
    it."""
    try:
        gains = drive_gains(_fit(study.with_(model="C"), progress))
    except RecordingError as error:
        raise StudyError(
            str(study.file),
            "drive_gains",
            "with motor signals alone the scale of all torques is unknown; "
            "give payload_mass: {L: kg} of one weighed payload, or recordings with joint torques "
            f"({error})",
        ) from None
    result = _fit(study.with_(drive_gains=tuple(gains)), progress)
    said = "drive gains as identified by model C: " + ", ".join(f"{gain:.4g}" for gain in gains)
    return replace(result, notes=(said, *result.notes))


def drive_gains(result: FitResult) -> list[float]:
    """Identified gains [N m per drive unit], one per joint."""
    return [float(result.estimate.chi[column]) for _, column in sorted(result.columns.gain_columns.items())]


def _fit(study: Study, progress: Progress) -> FitResult:
    prepared = prepare_study(study, progress)
    trials: tuple[CutoffTrial, ...] = ()
    if study.filter.decimation_cutoff_hz == "auto":
        columns = prepared.columns
        first = first_cutoff(prepared.streams, study, len(columns.parameters))
        seconds = excerpt_seconds(first, len(columns.channels), len(columns.parameters))
        progress("choosing the decimation cut-off")
        excerpts = build(prepared, first, roles=("identify",), excerpt_s=seconds)
        guess, _ = estimate_all(excerpts, prepared)
        cutoff, trials = choose_cutoff(prepared, guess.chi, seconds, progress)
    else:
        cutoff = study.filter.decimation_cutoff_hz
    systems = build(prepared, cutoff, progress=progress)
    return fit_systems(prepared, systems, cutoff, trials, progress)


def estimate_all(
    systems: Sequence[RecordingSystem], prepared: Prepared
) -> tuple[Estimate, tuple[ChannelFactor, ...]]:
    """WLS of all base parameters on the identify recordings, with the study's options. -> estimate, factors
    used."""
    study, names = prepared.study, prepared.columns.parameters
    factors = stack(systems)
    if prepared.columns.gain_columns:
        return estimate_with_gains(factors, prepared.columns), factors
    sigma = channel_sigma(factors)
    estimate = weighted_least_squares(factors, sigma, names)
    if study.robust == "huber":
        for _ in range(30):
            before = estimate.chi
            weighted, _ = huber_factors(systems, sigma, before)
            sigma = _robust_sigma(systems, before)
            estimate = weighted_least_squares(weighted, sigma, names)
            if np.all(np.abs(estimate.chi - before) <= 1e-3 * np.maximum(estimate.std, 1e-12)):
                break
        factors, _ = huber_factors(systems, sigma, estimate.chi)
        estimate = weighted_least_squares(factors, sigma, names)
    if not estimate.active.any():
        raise FitFailedError("no parameter is excited by the identify recordings; record the robot moving")
    return estimate, factors


def _robust_sigma(systems: Sequence[RecordingSystem], chi: np.ndarray) -> np.ndarray:
    """sigma_j from the median of |rho| (1.4826 MAD), which outliers do not move."""
    rho = np.hstack([part for system in systems for part in system.residuals(chi)])
    return np.maximum(1.4826 * np.median(np.abs(rho), axis=1), 1e-9)


def fit_systems(
    prepared: Prepared,
    systems: tuple[RecordingSystem, ...],
    cutoff_hz: float,
    trials: tuple[CutoffTrial, ...] = (),
    progress: Progress = silent,
) -> FitResult:
    """Estimate, reduce, test and compare, from factors at one cut-off."""
    study, columns = prepared.study, prepared.columns
    fitted = [system for system in systems if system.role == "identify"]
    progress("least squares")
    full, _ = estimate_all(fitted, prepared)
    noises = channel_noises(fitted, full)
    full_covariance = honest_covariance(fitted, full, noises)
    share = min(1.0, sum(noise.effective_rows for noise in noises) / full.rows)
    normalised = _normalised(fitted, full)
    used = [segment.used for system in fitted for segment in system.segments]
    normality = kolmogorov_smirnov(
        np.concatenate([rho[count] for rho, count in zip(normalised, used)]), share
    )
    reduction = _reduction(study, columns, full, share)
    estimate, at_bound = (
        bounded(reduction.estimate) if study.bounds == "physical" else (reduction.estimate, ())
    )
    covariance = honest_covariance(fitted, estimate, channel_noises(fitted, estimate))
    normalised = _normalised(fitted, estimate)
    notes = [*study.remarks, *(note for stream in prepared.streams for note in stream.notes)]
    warnings = [warning for stream in prepared.streams for warning in stream.warnings]
    warnings += _excitation_warnings(full, fitted)
    notes += [f"{name} held at its physical bound, zero" for name in at_bound]
    notes += _payload_notes(study, estimate, covariance)
    compared = compare_torques(
        prepared.streams,
        prepared.banks,
        columns,
        estimate.chi,
        full.chi,
        cutoff_hz,
        study.filter.order,
        progress,
    )
    worst = max(compared.decimated.by_role()["identify"].values())
    if worst > BAD_PERCENT:
        progress("asking why the fit is bad")
        warnings += suspected_mix_ups(prepared.streams, prepared.banks, columns)
    warnings += _implausible(estimate)
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
        tuple(warnings),
    )


def _reduction(study: Study, columns: Columns, full: Estimate, share: float) -> Reduction:
    if not study.reduction:
        return Reduction(full, full, (), study.reduction_alpha)
    keep = frozenset(columns.parameters[k] for k in columns.gain_columns.values())
    return reduce(full, study.reduction_alpha, share if study.effective_rows else 1.0, keep)


def _normalised(systems: Sequence[RecordingSystem], estimate: Estimate) -> list[np.ndarray]:
    """Residuals over sigma_j (eq. 14), (channels, m) for each segment."""
    return [rho / estimate.sigma[:, None] for system in systems for rho in system.residuals(estimate.chi)]


def _excitation_warnings(full: Estimate, systems: Sequence[RecordingSystem]) -> list[str]:
    """Which parameters the motion leaves open, in words."""
    out = [
        f"{dependence.sentence()}; the identify recordings cannot tell them apart"
        if dependence.seen_in
        else f"{dependence.sentence()} by the identify recordings"
        for dependence in full.dependent
    ]
    if full.weak:
        out.append(
            f"the motion hardly excites {', '.join(full.weak)} "
            f"(condition number {full.condition_number:.3g}); "
            "add motions that move those joints faster and at other postures"
        )
    if len(systems) > 1:
        out += _blind_runs(full, systems)
    return out


def _blind_runs(full: Estimate, systems: Sequence[RecordingSystem]) -> list[str]:
    """Recordings whose motion leaves a parameter out that another one excites."""
    b = len(full.chi)
    lengths = np.zeros((len(systems), b))
    carried = np.zeros((len(systems), b), bool)
    for k, system in enumerate(systems):
        for factor, sigma in zip(system.factors, full.sigma):
            lengths[k, factor.columns] += np.sum((factor.R[:, :-1] / sigma) ** 2, axis=0) / max(
                factor.rows, 1
            )
            carried[k, factor.columns] = True
    best = lengths.max(axis=0)
    out = []
    for k, system in enumerate(systems):
        blind = [full.parameters[i] for i in np.flatnonzero(carried[k] & (lengths[k] < 1e-4 * best))]
        if blind:
            out.append(
                f"{system.label} does not excite {', '.join(blind[:8])}{' ...' if len(blind) > 8 else ''}"
            )
    return out


def _implausible(estimate: Estimate) -> list[str]:
    """Masses of tonnes and friction of kilonewton metres: torque is in N mm, or in drive units."""
    heavy = [
        name
        for name, value in zip(estimate.parameters, estimate.chi)
        if abs(value) > 5e4 or (name[0] == "M" and name[1:2] not in "XYZ" and abs(value) > 2e3)
    ]
    if not heavy:
        return []
    return [
        f"parameters such as {heavy[0]} come out larger than robots are; "
        "torque looks recorded in N mm or in drive "
        "units, if so give scale: 0.001 or drive_gains in the study"
    ]


def _payload_notes(study: Study, estimate: Estimate, covariance: np.ndarray) -> list[str]:
    out = []
    for label, mass in study.payload_mass.items():
        name = f"M{label}"
        if name in estimate.parameters and estimate.active[estimate.parameters.index(name)]:
            k = estimate.parameters.index(name)
            out.append(
                f"{name} identified as {estimate.chi[k]:.4g} kg (std {np.sqrt(covariance[k, k]):.2g}), "
                f"weighed {mass:g} kg, difference {100 * (estimate.chi[k] / mass - 1):+.2g} %"
            )
    return out


def interval_factor(free: float, level: float = 0.95) -> float:
    """Half width of the two-sided interval in standard deviations (Student's t)."""
    return float(scipy.special.stdtrit(max(free, 1.0), 0.5 + level / 2))


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
