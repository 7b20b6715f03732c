"""Results as plain text, for `str()` of them, and as the small table that a notebook shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ident.estimation.fit import FitResult
from ident.report.files import error_table, fit_document, parameter_table
from ident.report.fit_report import left_over, parameter_section, verdict
from ident.report.joints import named, names_of, with_names
from ident.report.page import Table
from ident.report.render import render_table
from ident.report.wording import check_sentences, holds_numbers


def text_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns in line: the first, and those that hold words, to the left, numbers to the right."""
    lines = [header, *rows]
    sides = "".join(">" if holds_numbers(rows, k) else "<" for k in range(len(header)))
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]
    return "\n".join(
        "  ".join(f"{cell:{side}{width}}" for cell, side, width in zip(line, sides, widths)).rstrip()
        for line in lines
    )


def fit_summary(result: FitResult) -> str:
    """Checks, verdict, errors, essential parameters, warnings, what is left; without a date or an id."""
    document = fit_document(result)
    names = names_of(document)
    parts = [f"{document['robot']}, model {document['model']}"]
    parts += check_sentences(document["checks"], names)
    parts += [
        verdict(document),
        "",
        text_table(*with_names(*error_table(result), names)),
        "",
        text_table(*with_names(*parameter_table(result), names)),
    ]
    parts += ["", *[named(f"warning: {text}", names) for text in result.warnings]]
    return "\n".join([*parts, named(left_over(document), names)])


def fit_table(result: FitResult) -> str:
    """The report's table of parameters as HTML, under its verdict."""
    document = fit_document(result)
    return _fragment(verdict(document), document["checks"], parameter_section(document).blocks)


def diagnosis_summary(document: Mapping[str, Any]) -> str:
    """Checks, verdict, findings, what is unexplained, errors before and after."""
    from ident.report.finding_words import before_and_after
    from ident.report.verdict_words import told, verdict

    names = names_of(document)
    parts = [f"{document['robot']}, model {document['model']}"]
    parts += check_sentences(document.get("checks", ()), names)
    parts += [named(text, names) for text in (verdict(document), *told(document))]
    return "\n".join([*parts, "", text_table(*with_names(*before_and_after(document), names))])


def diagnosis_table(document: Mapping[str, Any]) -> str:
    """The findings in words and the errors before and after, as HTML."""
    from html import escape

    from ident.report.diagnosis_report import error_section
    from ident.report.verdict_words import told, verdict

    found = "".join(f"<li>{escape(text)}</li>" for text in told(document))
    blocks = error_section(document).blocks
    return _fragment(
        verdict(document), document.get("checks", ()), blocks, f"<ul>{found}</ul>" if found else ""
    )


def _fragment(said: str, checks: Sequence[Mapping[str, Any]], blocks: Sequence[Any], more: str = "") -> str:
    from html import escape

    lines = "".join(f"<p>{escape(sentence)}</p>" for sentence in check_sentences(checks))
    tables = "".join(render_table(block) for block in blocks if isinstance(block, Table))
    return f"<div>{lines}<p><strong>{escape(said)}</strong></p>{more}{tables}</div>"
