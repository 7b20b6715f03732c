"""`diagnosis.json` (contract 6) from a Diagnosis. Nothing is estimated here."""

from typing import Any

from ident.diagnosis.diagnosis import Diagnosis
from ident.diagnosis.error_table import errors_by_recording


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """Plain values, findings strongest first."""
    return {
        "verdict": diagnosis.verdict,
        "robot": diagnosis.robot,
        "model": diagnosis.model,
        "findings": [
            {
                "effect": f.effect,
                "joints": list(f.joints),
                "channel": f.channel,
                "parameters": f.parameters,
                "evidence": {
                    "p_value": f.p_value,
                    "error_drop_percent": f.error_drop_percent,
                    "log_likelihood_gain": f.gain,
                    "held_out_gain": f.held_out_gain,
                },
                "alternatives": [
                    {"effect": a.effect, "joints": list(a.joints), "error_drop_percent": a.error_drop_percent}
                    for a in f.alternatives
                ],
            }
            for f in diagnosis.findings
        ],
        "unexplained": [
            {
                "joints": list(u.joints),
                "channel": u.channel,
                "depends_on": list(u.depends_on),
                "share_of_residual_percent": u.share_of_residual_percent,
            }
            for u in diagnosis.unexplained
        ],
        "error_percent": {"before": diagnosis.before, "after": diagnosis.after},
        "error_percent_by_recording": {
            "before": errors_by_recording(diagnosis.outcome.first),
            "after": errors_by_recording(diagnosis.outcome.last),
        },
        "noise_floor_percent": diagnosis.noise_floor_percent,
        "notes": list(diagnosis.notes),
        "regenerated": _regenerated(diagnosis),
    }


def _regenerated(diagnosis: Diagnosis) -> dict[str, Any]:
    if diagnosis.regenerated is None:
        return {"effects": [], "not_columns": [], "largest_relative_difference": None}
    return diagnosis.regenerated.document()
