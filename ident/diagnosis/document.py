"""`diagnosis.json` (contract 6) from a Diagnosis. Nothing is estimated here."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from ident.diagnosis.diagnosis import Diagnosis
from ident.diagnosis.extended.on_judging_runs import counted_error
from ident.diagnosis.outcome import Step
from ident.diagnosis.telling.findings import Alternative, Finding, Hint, Unexplained
from ident.diagnosis.telling.requests import own_effects_of, robot_of, separable, separating_command
from ident.estimation.fit import FitResult
from ident.report.joints import joints_of
from ident.report.numbers import finite

PLACE = {"source_joint": "", "recording": "", "from": "s", "to": "s", "link": ""}  # contract 7: parameters


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """Plain values, findings strongest first, what was found in the data before them."""
    before, after, undone = diagnosis.first, diagnosis.last, diagnosis.undone
    document: dict[str, Any] = {
        "checks": [check.document() for check in diagnosis.checks],
        "unsettled": [
            {"robot_file": c.robot_file, "recording": c.recording, "message": c.message}
            for c in diagnosis.unsettled
        ],
        "assumed": [{"recording": c.recording, "message": c.message} for c in diagnosis.assumed],
        "unanswered": [{"recording": c.recording, "message": c.message} for c in diagnosis.unanswered],
        "verdict": diagnosis.verdict,
        "robot": diagnosis.robot,
        "model": diagnosis.model,
        "joints": joints_of(before.columns.model),
        "alpha": diagnosis.alpha,
        "uses": {stream.label: stream.role for stream in before.recordings},
        "judged": _judged(diagnosis),
        "findings": [_finding(f, diagnosis) for f in diagnosis.findings],
        "repeats": list(diagnosis.repeats),
        "unexplained": [_unexplained(u) for u in diagnosis.unexplained],
        "hints": [_hint(h) for h in diagnosis.hints],
        "explainable": {name: dict(values) for name, values in diagnosis.explainable.items()},
        "error_percent": {"before": before.full_rate_error, "after": after.full_rate_error},
        "error_percent_by_recording": {
            "before": before.errors.full_rate.by_recording(),
            "after": after.errors.full_rate.by_recording(),
        },
        "error_percent_counted": _counted(diagnosis, before, after),
        "faults_undone": undone
        and {
            "error_percent": undone.full_rate_error,
            "error_percent_by_recording": undone.errors.full_rate.by_recording(),
        },
        "noise_floor_percent": dict(diagnosis.noise_floor_percent),
        "white_noise_percent": dict(diagnosis.white_noise_percent),
        "smallest_visible": [{**asdict(its), "joints": list(its.joints)} for its in diagnosis.visible],
        "notes": [*diagnosis.notes, *after.notes],
    }
    return dict(finite(document))


def _counted(diagnosis: Diagnosis, *fits: FitResult) -> dict[str, Any]:
    """Of the samples alone that the equations count, on the runs that chose nothing."""
    if diagnosis.outcome is None:
        return {}
    rows = diagnosis.outcome.last.rows
    return {when: counted_error(fit, rows) for when, fit in zip(("before", "after"), fits)}


def _judged(diagnosis: Diagnosis) -> dict[str, Any]:
    """The rows that every comparison was made on, and the log E that the rate asks for there."""
    if diagnosis.outcome is None:
        return {"recordings": [], "apart": False, "log_e_asked": None}
    rows = diagnosis.outcome.last.rows
    names = [name for k, name in enumerate(rows.names) if (rows.judged & (rows.recording == k)).any()]
    return {"recordings": names, "apart": bool(rows.held_apart), "log_e_asked": diagnosis.outcome.tau}


def _finding(f: Finding, diagnosis: Diagnosis) -> dict[str, Any]:
    told = f.log_e < float("inf")  # by the loop; else by the examination, before any fit
    step = _step(f, diagnosis)
    placed = {
        name: {"value": f.where[name], "std": None, "unit": unit, "at_bound": False}
        for name, unit in PLACE.items()
        if name in f.where and name not in f.parameters
    }
    document = {
        "effect": f.effect,
        "joints": list(f.joints),
        "channel": f.channel,
        **dict(f.where),
        "parameters": {**placed, **{name: dict(values) for name, values in f.parameters.items()}},
        "evidence": {
            "p_value": f.p_value if told else None,
            "error_drop_percent": f.error_drop_percent if told else None,
            "log_e": f.log_e if told else None,
            "gain_fitted": f.gain if told else None,
            "blocks_for": None if step is None else int((step.evidence.blocks > 0).sum()),
            "blocks": None if step is None else int(np.count_nonzero(step.evidence.blocks)),
        },
        "grade": f.grade,
        "remedy": f.remedy,
        "signature": f.signature,
    }
    robot, model, own = robot_of(diagnosis.study), diagnosis.model, own_effects_of(diagnosis.study)
    equal = [
        {
            **_alternative(a),
            "separate": separating_command(robot, document, [other], model, own),
            "seconds_as_recorded": a.seconds,
        }
        if separable(document, other := _alternative(a))
        else _alternative(a)
        for a in f.equivalent
    ]
    rivals = [a for a in f.equivalent if separable(document, _alternative(a))]
    if rivals:
        seconds = [a.seconds for a in rivals if a.seconds is not None]
        document["separate"] = {
            "command": separating_command(robot, document, [_alternative(a) for a in rivals], model, own),
            "seconds": f.seconds_offered,
            "seconds_as_recorded": max(seconds) if seconds else None,
            "so_far": [dict(its) for its in f.so_far],
        }
    return {**document, "alternatives": [_alternative(a) for a in f.equivalent], "equivalent": equal}


def _step(f: Finding, diagnosis: Diagnosis) -> Step | None:
    """What the loop saw when it took the finding in."""
    steps = diagnosis.outcome.steps if diagnosis.outcome is not None else ()
    same = (s for s in steps if s.term.effect.name == f.effect and float(s.evidence.log_e) == f.log_e)
    return next(same, None)


def _alternative(a: Alternative) -> dict[str, Any]:
    return {
        **a.named,
        "log_e": a.log_e,
        "error_drop_percent": a.error_drop_percent,
    }


def _hint(h: Hint) -> dict[str, Any]:
    return {
        **_alternative(h.what),
        "channel": h.channel,
        "blocks_for": h.blocks_for,
        "blocks": h.blocks,
        "equivalent": [_alternative(a) for a in h.equivalent],
    }


def _unexplained(u: Unexplained) -> dict[str, Any]:
    return {
        "joints": list(u.joints),
        "channel": u.channel,
        **({} if u.stretch is None else dict(zip(("recording", "from", "to", "first_stamp"), u.stretch))),
        "depends_on": list(u.depends_on),
        "oscillates": u.oscillates_hz is not None,
        "oscillates_hz": u.oscillates_hz,
        "or_on": list(u.alike),
        "share_of_residual_percent": u.share_of_residual_percent,
        "log_e": u.log_e,
        "nearest": None if u.nearest is None else _alternative(u.nearest),
        "carries_over": u.carries_over,
        "judged_could_show_it": not u.unseen,
        "parameters_change_times_noise": None if u.of_its_kind else u.times_noise,
        "its_kind_changes_times_noise": u.times_noise if u.of_its_kind else None,
        "nearest_by_chance": u.by_chance,
        "error_percent_with_nearest": None if u.errors is None else dict(zip(("without", "with"), u.errors)),
        "on_fitted_runs": None if u.on_fitted is None else dict(zip(("nearest", "functions"), u.on_fitted)),
    }
