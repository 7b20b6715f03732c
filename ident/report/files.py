"""`fit.json` (contract 5) and the tables beside it, from a FitResult. Nothing is estimated here.

A cancelled parameter has the value 0, as in the reduced model whose errors are quoted; what the full model
gave for it stands in `full_value`. `std` is the honest standard deviation (noise.py, FitResult.std),
`std_selected` the one that takes the cancelled parameters as known to be zero, `std_white` that of eq. 15.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ident.estimation.fit import FitResult, interval_factor
from ident.estimation.found_effects import found_effects
from ident.export.saved import keep
from ident.report.joints import joints_of
from ident.report.numbers import finite

Row = tuple[str, ...]


def fit_document(result: FitResult) -> dict[str, Any]:
    """The content of fit.json as plain values; None where a number is none."""
    columns, estimate, full = result.columns, result.estimate, result.full
    free = max(result.effective_rows - full.b, 1.0)
    channels = columns.channels
    of_effects = {name for term in result.terms for name in term.names}
    document: dict[str, Any] = {
        "checks": [check.document() for check in result.checks],
        "robot": columns.model.robot_name,
        "model": result.study.model,
        "joints": joints_of(columns.model),
        "base_parameters": len(columns.parameters) - len(of_effects),
        "essential_parameters": estimate.b,
        "essential_effect_parameters": len(of_effects & set(estimate.parameters)),
        "parameters": _parameters(result, interval_factor(free)),
        "effects": [found.document() for found in found_effects(result)],
        "relative_error_percent": result.relative_error,
        "full_rate_error_percent": result.full_rate_error,
        "relative_error_full_model_percent": result.errors.decimated_full_model.by_role(),
        "tests": {
            "durbin_watson": result.durbin_watson,
            "kolmogorov_smirnov": {
                "statistic": result.normality.statistic,
                "p_value": result.normality.p_value,
            },
            "condition_number": full.condition_number,
            "condition_number_essential": estimate.condition_number,
            "rows": estimate.rows,
            "effective_rows": result.effective_rows,
            **({"durbin_wu_hausman": result.feedback.document()} if result.feedback else {}),
        },
        "sigma": {name: float(sigma) for name, sigma in zip(channels, estimate.sigma)},
        "filter": {
            "position_cutoff_hz": result.study.filter.position_cutoff_hz,
            "decimation_cutoff_hz": result.cutoff_hz,
            "path": result.study.filter.path,
            "order": result.study.filter.order,
            "trials": [
                {
                    "decimation_cutoff_hz": trial.cutoff_hz,
                    "durbin_watson": trial.durbin_watson,
                    "rows": trial.rows,
                }
                for trial in result.cutoff_trials
            ],
        },
        "reduction": {
            "alpha": result.reduction.alpha,
            "effective_rows_used": result.study.effective_rows,
            "steps": [
                {
                    "dropped": step.dropped,
                    "F": step.statistic,
                    "F_d": step.threshold,
                    "df": [step.df_num, step.df_den],
                    "p_value": step.p_value,
                    "accepted": step.accepted,
                }
                for step in result.reduction.steps
            ],
        },
        "not_identified": [dependence.sentence() for dependence in full.dependent],
        "unidentifiable": list(columns.model.unidentifiable),
        "recordings": _recordings(result),
        "notes": list(result.notes),
        "warnings": list(result.warnings),
    }
    return dict(finite(document))


def _parameters(result: FitResult, half_width: float) -> list[dict[str, Any]]:
    columns, estimate, full, std = result.columns, result.estimate, result.full, result.std
    selected = np.sqrt(np.diag(result.covariance))
    rows = []
    for k, name in enumerate(columns.parameters):
        essential = bool(estimate.active[k])
        value = float(estimate.chi[k])
        row = {
            "name": name,
            "value": value,
            "std": float(std[k]),
            "relative_std_percent": float(100 * std[k] / abs(value)) if essential and value else None,
            "essential": essential,
            "unit": columns.units[k],
            "regroups": columns.regroups.get(name, name),
            "std_white": float(estimate.std[k] if essential else full.std[k]),
            "interval_95": [value - half_width * float(std[k]), value + half_width * float(std[k])]
            if essential
            else None,
            "full_value": float(full.chi[k]) if full.active[k] else None,
            "std_selected": float(selected[k]) if essential else None,
            "impossible": result.impossible.get(name),
        }
        rows.append(row)
    for name, value in columns.known.items():
        rows.append(
            {
                "name": name,
                "value": value,
                "std": 0.0,
                "relative_std_percent": 0.0,
                "essential": True,
                "unit": "kg",
                "regroups": f"{name} (given)",
                "std_white": 0.0,
                "interval_95": [value, value],
                "full_value": value,
                "std_selected": 0.0,
            }
        )
    return rows


def _recordings(result: FitResult) -> list[dict[str, Any]]:
    full_rate, decimated = result.errors.full_rate.by_recording(), result.errors.decimated.by_recording()
    out = []
    for stream, system in zip(result.recordings, result.systems):
        survey = stream.survey
        out.append(
            {
                "name": stream.label,
                "use": stream.role,
                "payload": stream.payload,
                "rows": survey.rows,
                "rate_hz": survey.rate_hz,
                "resampled": not survey.uniform,
                "jitter_rms_s": survey.jitter_rms_s,
                "repeated_time_stamps": survey.same_stamp_rows,
                "repeated_rows": survey.repeated_rows,
                "held_positions": survey.held_position_rows,
                "missing_rows": survey.missing_rows,
                "segments": [
                    {"from": s.start, "to": s.end, "motion_from": s.move_start, "motion_to": s.move_end}
                    for s in survey.segments
                ],
                "samples_used": system.samples,
                "decimated_rows": system.rows,
                "relative_error_percent": decimated[stream.label],
                "full_rate_error_percent": full_rate[stream.label],
            }
        )
    return out


def parameter_table(result: FitResult) -> tuple[Row, list[Row]]:
    """Header and rows of the essential parameters: name, value, std, % std, unit; what physics forbids."""
    std, forbidden = result.std, result.impossible
    rows: list[Row] = []
    for k in np.flatnonzero(result.estimate.active):
        value = result.estimate.chi[k]
        rows.append(
            (
                result.columns.parameters[k],
                f"{value:.4g}",
                f"{std[k]:.2g}",
                f"{100 * std[k] / abs(value):.2g}",
                result.columns.units[k],
                *([forbidden.get(result.columns.parameters[k], "")] if forbidden else []),
            )
        )
    return ("parameter", "value", "std", "% std", "unit", *(["physics"] if forbidden else [])), rows


def error_table(result: FitResult) -> tuple[Row, list[Row]]:
    """Header and rows of relative errors in percent: one row per channel, one column per role and rate."""
    blocks = [(f"{role} %", errors) for role, errors in result.relative_error.items()]
    blocks += [(f"{role} % full rate", errors) for role, errors in result.full_rate_error.items()]
    names = ("total", *result.columns.channels)
    return ("channel", *(title for title, _ in blocks)), [
        (name, *(f"{errors[name]:.2f}" for _, errors in blocks)) for name in names
    ]


def comparison_table(results: Mapping[str, FitResult]) -> tuple[Row, list[Row]]:
    """The paper's Table II: value and % std of each model, |e %| to the first model with that line."""
    header: list[str] = ["parameter"]
    for number, model in enumerate(results):
        header += [f"{model} value", f"{model} % std"] + ([f"{model} |e %|"] if number else [])
    lines = {model: _lines(result) for model, result in results.items()}
    rows: list[Row] = []
    for name in dict.fromkeys(name for found in lines.values() for name in found):
        row, first = [name], None
        for number, (model, result) in enumerate(results.items()):
            place = lines[model].get(name)
            if place is None:
                row += ["-", "-"] + (["-"] if number else [])
                continue
            value, std = float(result.estimate.chi[place]), float(result.std[place])
            row += [f"{value:.4g}", f"{100 * std / abs(value):.2g}"]
            if number:
                row.append("-" if first is None else f"{100 * abs(value / first - 1):.2g}")
            first = value if first is None else first
        rows.append(tuple(row))
    return tuple(header), rows


def _lines(result: FitResult) -> dict[str, int]:
    """Lines of the table that a model fills: label -> position of the essential parameter.

    ZZ2 and ZZ2R share a line; friction of motor and link, which model A sees as one, shares that of the motor
    as in the paper; an inertia that rotor inertia was regrouped into (the paper's ZZ2Ra) has its own.
    """
    out = {}
    for k in np.flatnonzero(result.estimate.active):
        name = result.columns.parameters[k]
        rotors = (
            [] if name.startswith("Iam") else re.findall(r"Iam\w+", result.columns.regroups.get(name, ""))
        )
        out[" + ".join([name.removesuffix("R"), *rotors])] = int(k)
    return out


def write_csv(path: Path, table: tuple[Row, Sequence[Row]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(table[0])
        writer.writerows(table[1])


def write_document(path: Path, document: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(finite(document), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def write_into(result: FitResult, folder: Path, *, plots: bool = True) -> None:
    """Files of one fit into an existing folder: fit.json, fit.npz, parameters.csv, errors.csv, reduction.csv,
    plots/."""
    write_document(folder / "fit.json", fit_document(result))
    write_csv(folder / "parameters.csv", parameter_table(result))
    write_csv(folder / "errors.csv", error_table(result))
    steps = [
        (
            s.dropped,
            f"{s.statistic:.4g}",
            f"{s.threshold:.4g}",
            f"{s.p_value:.3g}",
            "cancelled" if s.accepted else "kept",
        )
        for s in result.reduction.steps
    ]
    write_csv(folder / "reduction.csv", (("parameter", "F", "F_d", "p", "verdict"), steps))
    keep(result, folder)
    if plots:
        from ident.report import fit_plots as drawing

        drawing.draw_all(result, folder / "plots")
