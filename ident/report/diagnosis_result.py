"""From a `Diagnosis` to its report: the residual against what gave each finding away, before and after."""

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from ident.diagnosis import Diagnosis
from ident.diagnosis.document import diagnosis_document
from ident.diagnosis.pictures import Picture
from ident.report.diagnosis_report import ResidualView, diagnosis_page
from ident.report.fit_result import channel_unit
from ident.report.page import ReportPage
from ident.report.render import render
from modelgen.effects import catalogue


def diagnosis_html(diagnosis: Diagnosis) -> str:
    """The report of a diagnosis as HTML."""
    return render(page_of(diagnosis, diagnosis_document(diagnosis)))


def page_of(diagnosis: Diagnosis, document: Mapping[str, Any]) -> ReportPage:
    """The page of a diagnosis; `document` is its diagnosis.json."""
    effects = catalogue()
    return diagnosis_page(
        document,
        title=f"{diagnosis.robot}, model {diagnosis.model}",
        views=views_of(diagnosis),
        rankings={},
        about={name: about(effects[name]) for name in effects},
        warnings=tuple(document.get("notes", ())),
        details=(_runs(diagnosis),),
        extra=(),
        footer=f"dynident {version('dynident')}. The numbers for programs are in diagnosis.json.",
    )


def about(effect: Any) -> str:
    """What an effect is, how it shows, who described it."""
    return f"{effect.summary.capitalize()}. In a residual: {effect.signature}. Source: {effect.source}."


def _runs(diagnosis: Diagnosis) -> str:
    runs = [
        f"{', '.join(run.label for run in diagnosis.first.recordings if run.role == role)} ({role})"
        for role in ("identify", "validate", "test")
        if any(run.role == role for run in diagnosis.first.recordings)
    ]
    return f"Model {diagnosis.model} of {diagnosis.robot} on {', '.join(runs)}."


def views_of(diagnosis: Diagnosis) -> tuple[ResidualView, ...]:
    """One view per finding and per unexplained structure that has a picture."""
    told = [
        *((("findings", k), f.picture) for k, f in enumerate(diagnosis.findings)),
        *((("unexplained", k), u.picture) for k, u in enumerate(diagnosis.unexplained)),
    ]
    return tuple(_view(diagnosis, place, picture) for place, picture in told if picture is not None)


def _view(diagnosis: Diagnosis, place: tuple[str, int], picture: Picture) -> ResidualView:
    return ResidualView(
        belongs_to=place,
        channel=picture.channel,
        variable=picture.against,
        variable_unit=picture.unit,
        unit=channel_unit(diagnosis.first.columns.model, picture.channel),
        x=picture.x,
        before=picture.before,
        after=picture.before - picture.effect if place[0] == "findings" else None,
    )
