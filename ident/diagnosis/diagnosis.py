"""The diagnosis as a value, and the way to it from a study. Pure of printing; recordings are read at the
edge."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ident.diagnosis.error_table import Percent, errors
from ident.diagnosis.findings import Finding, Unexplained, sure_findings, unexplained_of
from ident.diagnosis.loop import Outcome, run_loop
from ident.diagnosis.model_view import build_view
from ident.diagnosis.noise_floor import noise_floor
from ident.diagnosis.rows import build_rows
from ident.diagnosis.scoring import make_folds
from ident.diagnosis.state import first_state
from ident.progress import Progress, silent


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


def diagnose_study(study, progress: Progress = silent, max_terms: int | None = None) -> Diagnosis:
    """Fit, trace the residual to what the model lacks, add it, fit again. Raises IdentError and its
    relatives."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        return _diagnose(study, progress, max_terms)


def _diagnose(study, progress: Progress, max_terms: int | None) -> Diagnosis:
    import generated
    from ident.recordings.opening import need_of, open_recordings
    from modelgen.geometry.robot_file import load_robot

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
    from ident.estimation.fit import fit_study

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
    outcome, findings = sure_findings(outcome)
    unexplained = unexplained_of(outcome)
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
