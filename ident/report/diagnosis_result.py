"""From a `Diagnosis` to its page: pictures, what the effects are, which of them stand in the C of model/."""

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from ident.diagnosis import Diagnosis
from ident.diagnosis.document import diagnosis_document
from ident.diagnosis.telling.pictures import Picture
from ident.diagnosis.telling.requests import column_request
from ident.report.diagnosis_report import View, diagnosis_page
from ident.report.fit_result import channel_unit
from ident.report.joints import names_of, page_with_names
from ident.report.page import ReportPage
from ident.report.render import render
from modelgen.effects import catalogue


def diagnosis_html(diagnosis: Diagnosis) -> str:
    """The report of a diagnosis as HTML."""
    return render(page_of(diagnosis, diagnosis_document(diagnosis)))


def page_of(diagnosis: Diagnosis, document: Mapping[str, Any]) -> ReportPage:
    """The page of a diagnosis; `document` is its diagnosis.json."""
    requests = {k: column_request(finding) for k, finding in enumerate(document["findings"])}
    page = diagnosis_page(
        document,
        title=f"{diagnosis.robot}, model {diagnosis.model}",
        views=views_of(diagnosis),
        about={name: (e.summary, e.signature, e.source) for name, e in catalogue().items()},
        programs={
            k: f". Its term as C, to compensate it (the diagnosis writes it into model/): regenerate-model "
            f"{diagnosis.study.robot} --model {diagnosis.model} --effect {request} -o FOLDER"
            for k, request in requests.items()
            if request
        },
        warnings=diagnosis.notes,
        details=(
            _runs(diagnosis),
            "ident fit extended_study.yaml gives the errors after, and these parameters, again.",
        ),
        footer=f"dynident {version('dynident')}. The numbers for programs are in diagnosis.json.",
    )
    return page_with_names(page, names_of(document))


def _runs(diagnosis: Diagnosis) -> str:
    runs = [
        f"{', '.join(run.label for run in diagnosis.first.recordings if run.role == role)} ({role})"
        for role in ("identify", "validate", "test")
        if any(run.role == role for run in diagnosis.first.recordings)
    ]
    return f"Model {diagnosis.model} of {diagnosis.robot} on {', '.join(runs)}."


def views_of(diagnosis: Diagnosis) -> tuple[View, ...]:
    """One view per finding and per unexplained structure that has a picture."""
    told = [
        *((("findings", k), f.picture) for k, f in enumerate(diagnosis.findings)),
        *((("unexplained", k), u.picture) for k, u in enumerate(diagnosis.unexplained)),
    ]
    return tuple(_view(diagnosis, place, picture) for place, picture in told if picture is not None)


def _view(diagnosis: Diagnosis, place: tuple[str, int], picture: Picture) -> View:
    unit = channel_unit(diagnosis.first.columns.model, picture.channel)
    names = (picture.channel, picture.against, picture.unit, unit)
    return View(place, *names, picture.x, picture.before, picture.effect)
