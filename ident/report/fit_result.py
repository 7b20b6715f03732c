"""From a `FitResult` to its report: the document of fit.json, the curves, the data and the reduction."""

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ident.estimation.fit import FitResult
from ident.report.files import comparison_table, fit_document, write_csv, write_into
from ident.report.fit_report import SHOWN, Curve, essential, fit_page
from ident.report.joints import names_of, page_with_names
from ident.report.page import Cell, Column, Panel, Plot, ReportPage, Section, Table, Trace
from ident.report.render import render, write
from ident.report.wording import number, percent


def fit_html(result: FitResult) -> str:
    """The report of one fit as HTML."""
    return render(page_of(result, fit_document(result)))


def page_of(result: FitResult, document: Mapping[str, Any]) -> ReportPage:
    """The page of a fit; `document` is its fit.json."""
    page = fit_page(
        document,
        curves_of(result, document),
        histogram=histogram(result.normalised),
        warnings=result.warnings,
        details=details(document),
        extra=(recording_section(document), reduction_section(document)),
        footer=f"dynident {version('dynident')}. Numbers for programs are in fit.json beside this file.",
    )
    return page_with_names(page, names_of(document))


def write_fit(result: FitResult, folder: Path) -> None:
    """All files of a fit into an existing folder: fit.json, tables, plots/, report.html."""
    write_into(result, folder)
    write(page_of(result, fit_document(result)), folder / "report.html")


def write_fits(results: Mapping[str, FitResult], folder: Path) -> None:
    """Into an existing folder: one a model, the parameter table across them (Table II), report.html."""
    for model, result in results.items():
        (folder / model).mkdir()
        write_fit(result, folder / model)
    write_csv(folder / "comparison.csv", comparison_table(results))
    write(comparison_page(results), folder / "report.html")


def curves_of(result: FitResult, document: Mapping[str, Any]) -> tuple[Curve, ...]:
    """One curve per recording (those with the largest errors) and channel, at the rate that is kept for
    drawing."""
    errors = {item["name"]: item["full_rate_error_percent"] for item in document["recordings"]}
    shown = sorted(errors, key=lambda label: -errors[label]["total"])[:SHOWN]
    return tuple(
        Curve(
            recording=curves.label,
            role=curves.role,
            channel=channel,
            unit=channel_unit(result.columns.model, channel),
            t=curves.t,
            measured=curves.measured[:, k],
            modelled=curves.modelled[:, k],
            error_percent=errors[curves.label][channel],
        )
        for curves in result.errors.curves
        if curves.label in shown
        for k, channel in enumerate(result.columns.channels)
    )


def channel_unit(model: Any, channel: str) -> str:
    """N m, or N where the channel's joint is prismatic."""
    label = channel.lstrip("taumld_")
    return "N" if label in {str(joint) for joint in getattr(model, "prismatic", ())} else "N m"


def details(document: Mapping[str, Any]) -> tuple[str, ...]:
    """What was fitted on what, in a line."""
    recordings, filters = document["recordings"], document["filter"]
    runs = [
        f"{', '.join(item['name'] for item in recordings if item['use'] == use)} ({use})"
        for use in ("identify", "validate", "test")
        if any(item["use"] == use for item in recordings)
    ]
    return (
        f"Model {document['model']} of {document['robot']} on {', '.join(runs)}; positions filtered at "
        f"{number(filters['position_cutoff_hz'], 3)} Hz, decimated below "
        f"{number(filters['decimation_cutoff_hz'], 3)} Hz.",
    )


def histogram(normalised: np.ndarray) -> Plot:
    """Density of normalised errors (channels, rows) beside the Gaussian that weighting assumes (figure 3)."""
    values = np.ravel(normalised)
    values = values[np.abs(values) < 5]
    density, edges = np.histogram(values, bins=60, range=(-5, 5), density=True)
    x = np.linspace(-5, 5, 201)
    traces = (
        Trace("normalised error", (edges[1:] + edges[:-1]) / 2, density, "model", kind="bars"),
        Trace("Gaussian", x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), "error"),
    )
    return Plot("Normalised error ρ / σ", "ρ / σ [-]", (Panel("density", traces, share=1.5),))


def recording_section(document: Mapping[str, Any]) -> Section:
    """What was read, and everything that was dropped or changed."""
    columns = (
        Column("recording"),
        Column("use"),
        Column("payload"),
        Column("samples", True),
        Column("rate [Hz]", True),
        Column("jitter [ms]", True, help="rms of the sampling interval"),
        Column("segments", True, help="gaps are never bridged"),
        Column("rows after decimation", True),
        Column("error", True),
    )
    rows = []
    for item in document["recordings"]:
        jitter = 1000 * (item["jitter_rms_s"] or 0.0)
        error = item["relative_error_percent"]["total"]
        rows.append(
            (
                Cell(item["name"]),
                Cell(item["use"]),
                Cell(item["payload"] or ""),
                Cell(str(item["rows"]), item["rows"]),
                Cell(number(item["rate_hz"], 4), item["rate_hz"]),
                Cell(number(jitter, 2), jitter),
                Cell(str(len(item["segments"])), len(item["segments"])),
                Cell(str(item["decimated_rows"]), item["decimated_rows"]),
                Cell(percent(error), error),
            )
        )
    blocks = [Table("", columns, tuple(rows))]
    if document["notes"]:
        notes = tuple((Cell(note),) for note in document["notes"])
        blocks.append(Table("Notes", (Column("what was found, dropped or changed"),), notes))
    return Section("Recordings", tuple(blocks))


def reduction_section(document: Mapping[str, Any]) -> Section:
    """Each step of the model reduction, and the cut-offs that were tried."""
    reduction = document["reduction"]
    columns = (
        Column("step", True),
        Column("parameter"),
        Column("F", True, help="eq. 18"),
        Column("F_d", True, help="critical value of the F distribution"),
        Column("p", True),
        Column("outcome"),
    )
    rows = tuple(
        (
            Cell(str(place), place),
            Cell(step["dropped"]),
            Cell(number(step["F"], 3), step["F"]),
            Cell(number(step["F_d"], 3), step["F_d"]),
            Cell(number(step["p_value"], 2), step["p_value"]),
            Cell("cancelled" if step["accepted"] else "kept, so the reduction ends"),
        )
        for place, step in enumerate(reduction["steps"], start=1)
    )
    blocks = [Table("F-statistic, largest relative deviation first", columns, rows)]
    trials = document["filter"]["trials"]
    if trials:
        blocks.append(
            Table(
                "Cut-off of the decimation filter, chosen by the Durbin-Watson rule",
                (Column("cut-off [Hz]", True), Column("Durbin-Watson", True), Column("rows", True)),
                tuple(
                    (
                        Cell(number(trial["decimation_cutoff_hz"], 3), trial["decimation_cutoff_hz"]),
                        Cell(number(trial["durbin_watson"], 3), trial["durbin_watson"]),
                        Cell(str(trial["rows"]), trial["rows"]),
                    )
                    for trial in trials
                ),
            )
        )
    text = f"alpha = {number(reduction['alpha'], 2)}" + (
        ", with effective rows." if reduction["effective_rows_used"] else "."
    )
    return Section("Model reduction", tuple(blocks), text=text, folded=True)


def comparison_page(results: Mapping[str, FitResult]) -> ReportPage:
    """Several models of the same recordings side by side: the paper's Table II, then each model's errors."""
    documents = {model: fit_document(result) for model, result in results.items()}
    first = next(iter(documents.values()))
    header, rows = comparison_table(results)
    columns = (Column(header[0]), *(Column(title, number=True) for title in header[1:]))
    table = Table(
        "", columns, tuple(tuple(Cell("–" if item == "-" else item) for item in row) for row in rows)
    )
    errors = tuple(
        (
            Cell(f"model {model}"),
            *(
                Cell(percent(value), value if value is not None else "")
                for role in first["relative_error_percent"]
                for value in (document["relative_error_percent"].get(role, {}).get("total"),)
            ),
            Cell(essential(document)),
        )
        for model, document in documents.items()
    )
    error_columns = (
        Column("model"),
        *(Column(role, number=True) for role in first["relative_error_percent"]),
        Column("essential parameters"),
    )
    warnings = tuple(
        f"model {model}: {text}" for model, result in results.items() for text in result.warnings
    )
    curves = [
        (model, curve)
        for model, result in results.items()
        for curve in curves_of(result, documents[model])[:2]
    ]
    page = ReportPage(
        title=f"{first['robot']}, models {', '.join(results)}",
        kind="Comparison of models",
        verdict=" ".join(
            f"Model {model}: {percent(document['relative_error_percent']['identify']['total'])} error with "
            f"{document['essential_parameters']} parameters."
            for model, document in documents.items()
        ),
        tone="plain",
        sections=(
            Section("Errors", (Table("", error_columns, errors),)),
            Section(
                "Parameters",
                (table,),
                text="Value, relative standard deviation, and difference from the first model that has it. "
                "A name may stand for another sum in another model: each model's report has the rules.",
            ),
            Section(
                "Torque of the first two channels", tuple(_titled(model, curve) for model, curve in curves)
            ),
        ),
        warnings=warnings,
        footer=f"dynident {version('dynident')}. Each model has a folder with a report of its own.",
    )
    return page_with_names(page, names_of(first))


def _titled(model: str, curve: Curve) -> Plot:
    from dataclasses import replace

    from ident.report.fit_report import curve_plot

    plot = curve_plot(curve, 800)
    return replace(plot, title=f"model {model}, {curve.channel}", group=curve.recording)
