"""All files of a result into an existing folder: what the commands and `.save` of the door write."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ident.estimation.fit import FitResult
from ident.report.files import write_comparison, write_into
from ident.report.fit_result import comparison_html, fit_html


def write_fit(result: FitResult, folder: Path) -> None:
    """fit.json, tables, plots/, report.html."""
    write_into(result, folder)
    (folder / "report.html").write_text(fit_html(result), encoding="utf-8")


def write_fits(results: Mapping[str, FitResult], folder: Path) -> None:
    """A folder a model, comparison.csv, report.html."""
    write_comparison(results, folder)
    for model, result in results.items():
        (folder / model / "report.html").write_text(fit_html(result), encoding="utf-8")
    (folder / "report.html").write_text(comparison_html(results), encoding="utf-8")
