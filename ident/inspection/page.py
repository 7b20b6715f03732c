"""An inspection as a page: what was found, tables of signals, curves. Nothing is computed."""

from __future__ import annotations

import math
from dataclasses import asdict

from ident.inspection.inspection import Inspection, Log
from ident.report.joints import page_with_names
from ident.report.page import Cell, Column, Fact, Panel, Plot, Remark, ReportPage, Section, Table, Trace
from ident.report.wording import check_sentence, holds_numbers, number

QUANTITIES = (("q", "Positions"), ("motor", "Motor signals"), ("sensor", "Joint torques"))


def page(inspection: Inspection, study: str) -> ReportPage:
    """`study` is the name of the file that was written."""
    refused = [log for log in inspection.logs if log.refusal]
    open_lines = len(inspection.questions)
    verdict = next_step(inspection, study)
    facts = [Fact(str(len(inspection.logs)), "recordings"), Fact(str(open_lines), "lines to fill in")]
    if inspection.excitation is not None:
        seen = inspection.excitation
        facts.append(Fact(f"{seen.rank} of {seen.parameters}", "base parameters that the motion shows"))
    found = ReportPage(
        title=f"Inspection of {', '.join(log.label for log in inspection.logs[:3])}",
        kind="Inspection",
        verdict=verdict,
        tone="bad" if refused else "plain",
        sections=(*_excitation(inspection), *(_log(log) for log in inspection.logs)),
        facts=tuple(facts),
        checks=tuple(Remark(text, grave) for text, grave in remarks(inspection)),
        details=tuple(f"{log.label}: {text}" for log in inspection.logs for text in log.table.remarks)
        + tuple(text for log in inspection.logs for text in log.notes),
    )
    return page_with_names(found, inspection.joints)


def next_step(inspection: Inspection, study: str) -> str:
    """What to do now, in a sentence."""
    if inspection.questions:
        keys = [line.split(":")[0].strip("-{ ") for line in inspection.questions]
        asked = ", ".join(dict.fromkeys(keys))
        return f"Fill in {asked} in {study}, then run ident diagnose {study} -o RESULTS."
    return f"Nothing is left to fill in: run ident diagnose {study} -o RESULTS."


def remarks(inspection: Inspection) -> list[tuple[str, bool]]:
    """Refusals and checks, the gravest first, each with whether it was left as it is."""
    out = [(f"refused: {log.refusal}", True) for log in inspection.logs if log.refusal]
    out += [
        (check_sentence(asdict(check), inspection.joints), check.outcome != "mended")
        for check in inspection.checks
    ]
    if inspection.excitation_refusal:
        out.append((f"refused: {inspection.excitation_refusal}", True))
    return out


def log_rows(inspection: Inspection) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of the table of recordings."""
    header = ("recording", "rows", "seconds", "Hz", "jitter ms", "parts", "rest s", "missing")
    rows: list[tuple[str, ...]] = []
    for log in inspection.logs:
        survey = log.survey
        missing = sum(column.missing for column in log.table.columns)
        if survey is None:
            rows.append((log.label, str(log.table.rows), "", "", "", "", "", str(missing)))
            continue
        rows.append(
            (
                log.label,
                str(survey.rows),
                f"{log.length_s:.4g}",
                f"{survey.rate_hz:.4g}",
                f"{1e3 * survey.jitter_rms_s:.2g}",
                str(len(survey.segments)),
                f"{log.rest_s:.3g}",
                str(missing),
            )
        )
    return header, rows


def column_rows(log: Log) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of the table of one recording's columns."""
    header = ("column", "unit", "lowest", "highest", "step", "noise", "missing")
    rows: list[tuple[str, ...]] = [
        (
            column.name,
            column.unit,
            _short(column.lowest),
            _short(column.highest),
            _short(column.grid) if column.grid else "",
            "constant" if column.constant else _short(column.noise),
            str(column.missing) if column.missing else "",
        )
        for column in log.table.columns
    ]
    return header, [*rows, *((name, "", "", "", "", "not numbers", "") for name in log.table.text)]


def excitation_rows(inspection: Inspection) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The parameters that the motion shows least."""
    header = ("parameter", "interval wider by", "what shows it better")
    weakest = inspection.excitation.weakest if inspection.excitation else ()
    return header, [
        (
            weak.parameter,
            f"{weak.inflation:.3g}" if math.isfinite(weak.inflation) else "not shown",
            weak.remedy,
        )
        for weak in weakest
    ]


def _short(value: float) -> str:
    return number(value) if math.isfinite(value) else ""


def _table(title: str, data: tuple[tuple[str, ...], list[tuple[str, ...]]], caption: str = "") -> Table:
    header, rows = data
    columns = tuple(Column(name, holds_numbers(rows, k)) for k, name in enumerate(header))
    return Table(title, columns, tuple(tuple(Cell(text) for text in row) for row in rows), caption)


def _excitation(inspection: Inspection) -> tuple[Section, ...]:
    overview = Section("Recordings", (_table("", log_rows(inspection)),))
    if inspection.excitation is None:
        return (overview,)
    table = _table("Parameters shown least", excitation_rows(inspection))
    return overview, Section("What the motion shows", (table,), inspection.excitation.sentence)


def _log(log: Log) -> Section:
    plots = []
    for kind, title in QUANTITIES:
        curves = log.curves.get(kind, {})
        if curves:
            panels = tuple(
                Panel(name, (Trace(name, t, values, "measured"),)) for name, (t, values) in curves.items()
            )
            plots.append(Plot(title, "t in s", panels, group=log.label))
    caption = (
        "Values as they stand in the file; step: of a grid that they lie on; noise: of what is not smooth."
    )
    return Section(
        log.label, (*plots, _table("Columns", column_rows(log), caption)), log.refusal, folded=False
    )
