"""All files of a result into an existing folder: what the commands and `.save` of the door write."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ident.estimation.fit import FitResult
from ident.report.files import fit_document, write_comparison, write_into
from ident.report.fit_result import comparison_page, page_of
from ident.report.render import write


def write_fit(result: FitResult, folder: Path) -> None:
    """fit.json, tables, plots/, report.html."""
    write_into(result, folder)
    write(page_of(result, fit_document(result)), folder / "report.html")


def write_fits(results: Mapping[str, FitResult], folder: Path) -> None:
    """A folder a model, comparison.csv, report.html."""
    write_comparison(results, folder)
    for model, result in results.items():
        write(page_of(result, fit_document(result)), folder / model / "report.html")
    write(comparison_page(results), folder / "report.html")
