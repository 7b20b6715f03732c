"""All files of a diagnosis into an existing folder: what `ident diagnose` and `Diagnosis.save` write."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from ident.diagnosis import Diagnosis
from ident.estimation.found_effects import extended_study
from ident.export.saved import keep
from ident.recordings.study import expand
from ident.report.compensation import write_model
from ident.report.diagnosis_plots import draw_all
from ident.report.diagnosis_result import page_of
from ident.report.files import fit_document, write_csv, write_document
from ident.report.finding_words import before_and_after
from ident.report.render import write
from modelgen.errors import ModelgenError

OPENING = "# The study with what was found as its effects: ident fit on it gives the errors after again.\n"


def write_diagnosis(diagnosis: Diagnosis, document: Mapping[str, Any], folder: Path) -> None:
    """diagnosis.json, errors.csv, plots/, model/ with C of the extended model, extended_study.yaml, the
    extended model's fit.json and fit.npz (for `ident export` and `ident predict`), report.html."""
    write_document(folder / "diagnosis.json", document)
    write_document(folder / "fit.json", fit_document(diagnosis.last))
    keep(diagnosis.last, folder)
    write_csv(folder / "errors.csv", before_and_after(document))
    (folder / "extended_study.yaml").write_text(extended_text(diagnosis), encoding="utf-8")
    try:
        write_model(diagnosis.last, folder / "model")
    except ModelgenError as error:  # what was found stays, whatever the generator makes of it
        (folder / "model_not_written.txt").write_text(f"{error}\n", encoding="utf-8")
    draw_all(diagnosis, document, folder / "plots")
    write(page_of(diagnosis, document), folder / "report.html")


def extended_text(diagnosis: Diagnosis) -> str:
    """extended_study.yaml, its paths absolute: it works from wherever it is put."""
    study, keys = diagnosis.last.study, extended_study(diagnosis.last)
    here = study.path / expand(study.folder) if study.folder else study.path
    keys["folder"] = str(here.resolve())
    if Path(study.robot_source).is_file():
        keys["robot"] = str(Path(study.robot_source).resolve())
    if study.effects_folder:
        keys["effects_folder"] = str((study.path / expand(study.effects_folder)).resolve())
    tables = [entry.file for entry in study.recordings if entry.table is not None]
    lost = (
        f"# Tables in memory, to be saved under these names in folder: {', '.join(tables)}\n"
        if tables
        else ""
    )
    return OPENING + lost + yaml.safe_dump(keys, sort_keys=False, allow_unicode=True)
