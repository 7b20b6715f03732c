"""All files of a diagnosis into an existing folder: what `ident diagnose` and `Diagnosis.save` write."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from ident.estimation.fit import FitResult
from ident.estimation.found_effects import extended_study
from ident.recordings.study import expand
from ident.report.diagnosis_plots import draw_all
from ident.report.diagnosis_report import before_and_after
from ident.report.diagnosis_result import diagnosis_html
from ident.report.files import write_csv, write_document


def write_diagnosis(diagnosis: Any, document: Mapping[str, Any], folder: Path) -> None:
    """diagnosis.json, errors.csv, plots/, model/ with C of the extended model, extended_study.yaml,
    report.html."""
    write_document(folder / "diagnosis.json", document)
    write_csv(folder / "errors.csv", before_and_after(document))
    if diagnosis.last.terms:
        write_extended_study(diagnosis, folder / "extended_study.yaml")
        write_model(diagnosis.last, folder / "model")
    draw_all(diagnosis, document, folder / "plots")
    (folder / "report.html").write_text(diagnosis_html(diagnosis), encoding="utf-8")


def write_extended_study(diagnosis: Any, file: Path) -> None:
    """The study with what was found as its effects: `ident fit` on it gives the numbers of the diagnosis
    again."""
    study = diagnosis.last.study
    keys = extended_study(diagnosis.last)
    keys["robot"] = (
        str(Path(study.robot_source).resolve()) if Path(study.robot_source).is_file() else study.robot
    )
    first = study.path / expand(study.folder) if study.folder else study.path
    keys["folder"] = str(
        (study.path / study.folder if study.folder else study.path).resolve()
        if study.folder
        else first.resolve()
    )
    file.write_text(yaml.safe_dump(keys, sort_keys=False, allow_unicode=True), encoding="utf-8")


def write_model(result: FitResult, folder: Path) -> None:
    """C of the rigid model with the found effects that are columns; nothing where none is."""
    from modelgen.emit import regenerate

    joints = result.columns.need.joints
    requests = []
    for term in result.terms:
        place = term.place
        if term.effect.kind == "column" and place.joint is not None and place.recording is None:
            source = "" if place.source is None else f":source_joint={joints[place.source]}"
            requests.append(f"{term.effect.name}:{joints[place.joint]}{source}")
    if not requests:
        return
    plan = regenerate.plan(
        result.study.robot_source, (result.study.model,), tuple(requests), True, lambda text, done=None: None
    )
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in regenerate.files(plan, lambda text, done=None: None).items():
        (folder / name).write_text(text, encoding="utf-8")
