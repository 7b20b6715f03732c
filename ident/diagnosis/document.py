"""`diagnosis.json` (contract 6) from a Diagnosis. Nothing is estimated here."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ident.diagnosis.diagnosis import Alternative, Diagnosis, Finding, Unexplained


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """Plain values, findings strongest first, what was found in the data before them."""
    before, after = diagnosis.first, diagnosis.last
    return {
        "checks": [check.document() for check in diagnosis.checks],
        "verdict": diagnosis.verdict,
        "robot": diagnosis.robot,
        "model": diagnosis.model,
        "alpha": diagnosis.alpha,
        "findings": [_finding(f) for f in diagnosis.findings],
        "unexplained": [_unexplained(u) for u in diagnosis.unexplained],
        "explainable": {name: dict(values) for name, values in diagnosis.explainable.items()},
        "error_percent": {"before": before.full_rate_error, "after": after.full_rate_error},
        "error_percent_by_recording": {
            "before": before.errors.full_rate.by_recording(),
            "after": after.errors.full_rate.by_recording(),
        },
        "noise_floor_percent": dict(diagnosis.noise_floor_percent),
        "notes": [*diagnosis.notes, *after.notes],
    }


def _finding(f: Finding) -> dict[str, Any]:
    finite = f.log_e < float("inf")
    return {
        "effect": f.effect,
        "joints": list(f.joints),
        "channel": f.channel,
        **dict(f.where),
        "parameters": {name: dict(values) for name, values in f.parameters.items()},
        "evidence": {
            "p_value": f.p_value,
            "error_drop_percent": f.error_drop_percent,
            "log_e": f.log_e if finite else None,
            "gain_fitted": f.gain if finite else None,
        },
        "alternatives": [_alternative(a) for a in f.equivalent],
        "equivalent": [_alternative(a) for a in f.equivalent],
        "grade": f.grade,
        "remedy": f.remedy,
    }


def _alternative(a: Alternative) -> dict[str, Any]:
    return {**asdict(a), "joints": list(a.joints)}


def _unexplained(u: Unexplained) -> dict[str, Any]:
    return {
        "joints": list(u.joints),
        "channel": u.channel,
        "depends_on": list(u.depends_on),
        "share_of_residual_percent": u.share_of_residual_percent,
        "log_e": u.log_e,
        "nearest": None if u.nearest is None else _alternative(u.nearest),
    }
