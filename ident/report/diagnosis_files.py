"""All files of a diagnosis into an existing folder: what `ident diagnose` and `Diagnosis.save` write."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ident.diagnosis.document import diagnosis_document
from ident.diagnosis.regenerated import write_model
from ident.report.diagnosis_plots import draw_all
from ident.report.diagnosis_report import before_and_after
from ident.report.diagnosis_result import diagnosis_html
from ident.report.files import write_csv, write_document


def write_diagnosis(diagnosis: Any, document: Mapping[str, Any], folder: Path) -> None:
    """diagnosis.json, errors.csv, plots/, model/ with C and parameters of the extended model, report.html."""
    diagnosis = write_model(diagnosis, folder / "model")
    document = diagnosis_document(diagnosis)
    write_document(folder / "diagnosis.json", document)
    write_csv(folder / "errors.csv", before_and_after(document))
    draw_all(diagnosis, document, folder / "plots")
    (folder / "report.html").write_text(diagnosis_html(diagnosis), encoding="utf-8")
