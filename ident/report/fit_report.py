"""The report of a fit, from `fit.json` and the curves behind it. Nothing is computed but texts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ident.report.joints import names_of
from ident.report.page import Cell, Column, Fact, Panel, Plot, Remark, ReportPage, Section, Table, Trace
from ident.report.thinning import envelope, stretches_for, with_gaps
from ident.report.wording import (
    check_sentence,
    check_sentences,
    meaning,
    number,
    percent,
    readable_rule,
    readable_unit,
    shares_rows,
    with_deviation,
    worse_elsewhere,
)

ROLES = {
    "identify": "runs that were fitted",
    "validate": "runs that were not fitted",
    "test": "runs that were used for nothing else",
}
SHARED = {"validate": "runs whose rows were fitted, too", "test": "runs whose rows were used before"}
OPEN_RECORDINGS = 1  # further recordings start folded
SHOWN = 40  # recordings whose torques a page shows at most


@dataclass(frozen=True, slots=True)
class Curve:
    """Measured and reconstructed torque of one channel of one recording, after the position filter.

    Shapes: t, measured, modelled (N,); s and N m (N for a prismatic joint). `error_percent` as in fit.json.
    """

    recording: str
    role: str
    channel: str
    unit: str
    t: NDArray[np.float64]
    measured: NDArray[np.float64]
    modelled: NDArray[np.float64]
    error_percent: float


def fit_page(
    document: Mapping[str, Any],
    curves: Sequence[Curve],
    histogram: Plot | None = None,
    warnings: Sequence[str] = (),
    details: Sequence[str] = (),
    extra: Sequence[Section] = (),
    footer: str = "",
) -> ReportPage:
    """Verdict, warnings, errors, parameters, then torque by torque."""
    errors = document["relative_error_percent"]
    held_out = next((role for role in ("test", "validate") if role in errors), None)
    return ReportPage(
        title=f"{document['robot']}, model {document['model']}",
        kind="Identification",
        verdict=verdict(document),
        tone="plain",
        checks=remarks(document),
        warnings=tuple(text for text in warnings if not _told(document, text)),
        details=(*details, left_over(document)),
        facts=tuple(_facts(document, held_out)),
        sections=(
            _error_section(document),
            parameter_section(document),
            *_curve_sections(curves, len(document.get("recordings", ()))),
            _test_section(document, histogram),
            *extra,
        ),
        footer=footer,
    )


def verdict(document: Mapping[str, Any]) -> str:
    """The result in one sentence: how well the torque is explained, and by how many parameters."""
    errors = document["relative_error_percent"]
    count = f"{essential(document)} base parameters"
    of_effects = document.get("essential_effect_parameters", 0)
    if of_effects:
        count += f" and {of_effects} of effects"
    fitted = percent(errors["identify"]["total"])
    for role in ("test", "validate"):
        if role in errors:
            unseen = percent(errors[role]["total"])
            return (
                f"{count} explain the torque to {unseen} on {role_words(document, role)} "
                f"({fitted} where they were fitted)."
            )
    return f"{count} explain the torque they were fitted to, to {fitted}; no run was kept to check them on."


def essential(document: Mapping[str, Any]) -> str:
    """How many of all base parameters the F-test keeps."""
    kept = document["essential_parameters"] - document.get("essential_effect_parameters", 0)
    return f"{kept} of {document['base_parameters']}"


def remarks(document: Mapping[str, Any]) -> tuple[Remark, ...]:
    """`checks` of a document, for the top of its page."""
    checks, names = document.get("checks") or (), names_of(document)
    return tuple(
        Remark(sentence, not sentence.startswith("mended")) for sentence in check_sentences(checks, names)
    )


def role_words(document: Mapping[str, Any], role: str) -> str:
    """What its runs are, as far as the checks found that their rows are theirs alone."""
    uses = {run["name"]: run["use"] for run in document.get("recordings") or ()}
    return SHARED[role] if shares_rows(document, uses, role) else ROLES[role]


def _told(document: Mapping[str, Any], warning: str) -> bool:
    """Whether a warning is one of the checks."""
    return any(check_sentence(check).partition(": ")[2] == warning for check in document.get("checks") or ())


def left_over(document: Mapping[str, Any]) -> str:
    """What the fit does not explain, and who would look for it."""
    errors = document.get("full_rate_error_percent") or document["relative_error_percent"]
    role = next((role for role in ("test", "validate") if role in errors), "identify")
    channels = {name: value for name, value in errors[role].items() if name != "total"}
    worst = max(channels, key=lambda name: channels[name] or 0.0)
    most = f", most in {worst} ({percent(channels[worst])})" if len(channels) > 1 else ""
    whose = role_words(document, role)
    worse = "".join(f"{sentence} " for sentence in worse_elsewhere(errors))
    return (
        f"What is left: {percent(errors[role]['total'])} of the torque on {whose}{most}. "
        f"{worse}ident diagnose looks for what the model lacks in it."
    )


def _facts(document: Mapping[str, Any], held_out: str | None) -> list[Fact]:
    errors, tests = document["relative_error_percent"], document["tests"]
    facts = []
    for role in errors:
        facts.append(Fact(percent(errors[role]["total"]), f"relative error, {role_words(document, role)}"))
    facts.append(Fact(essential(document), "essential of all base parameters"))
    for row in document["parameters"]:
        if meaning(row["name"]).startswith("mass, payload"):
            facts.append(Fact(with_deviation(row["value"], row["std"], row["unit"]), meaning(row["name"])))
    durbin_watson = tests.get("durbin_watson")
    if durbin_watson is not None:
        good = 1 <= durbin_watson <= 3
        facts.append(
            Fact(number(durbin_watson, 3), "Durbin-Watson, 2 is best, 1 to 3 is fair", "" if good else "bad")
        )
    return facts


def _error_section(document: Mapping[str, Any]) -> Section:
    errors = document["relative_error_percent"]
    full = document.get("full_rate_error_percent", {})
    columns = [Column("channel")]
    for role in errors:
        columns.append(Column(role, number=True, help=f"{role_words(document, role)}, at the decimated rate"))
    for role in full:
        columns.append(Column(f"{role}, full rate", number=True, help="after the position filter only"))
    rows = []
    for channel in errors["identify"]:
        values = [block[role].get(channel) for block in (errors, full) for role in block]
        cells = [Cell(percent(value), "" if value is None else value) for value in values]
        rows.append((Cell("all channels" if channel == "total" else channel), *cells))
    table = Table("", tuple(columns), tuple(rows))
    text = (
        "100 ‖Y − W χ‖ / ‖Y‖, per channel and over all of them in unweighted torque. A joint that carries "
        "little torque has a large relative error with a small absolute one."
    )
    return Section("Error", (table,), text=text)


def parameter_section(document: Mapping[str, Any]) -> Section:
    impossible = any(row.get("impossible") for row in document["parameters"])
    columns = (
        Column("name"),
        Column("value", number=True),
        Column("σ", number=True, help="standard deviation"),
        Column("% σ", number=True, help="standard deviation relative to the value"),
        Column("unit"),
        Column("kept", help="essential: the F-statistic keeps it in the reduced model"),
        *([Column("physics", help="beyond its standard deviation")] if impossible else []),
        Column("regroups"),
        Column("meaning"),
    )
    rows = []
    for row in sorted(document["parameters"], key=lambda row: not row["essential"]):
        essential = row["essential"]
        relative = row["relative_std_percent"]
        tone = "" if essential else "faint"
        rule = row.get("regroups") or ""
        rows.append(
            (
                Cell(row["name"], tone=tone),
                Cell(number(row["value"]), row["value"] if row["value"] is not None else "", tone),
                Cell(number(row["std"], 2), row["std"] if row["std"] is not None else "", tone),
                Cell(percent(relative), relative if relative is not None else "", tone),
                Cell(readable_unit(row["unit"]), tone=tone),
                Cell("yes" if essential else "no", tone=tone),
                *([Cell(row.get("impossible") or "", tone="bad")] if impossible else []),
                Cell("" if rule == row["name"] else readable_rule(rule), tone=f"{tone} wide"),
                Cell(meaning(row["name"]), tone=f"{tone} wide"),
            )
        )
    text = (
        "A base parameter stands for the sum in the column “regroups”; no motion can tell its terms apart. "
        "Friction with m acts before the torque sensor, with l after it."
    )
    return Section("Parameters", (Table("", columns, tuple(rows)),), text=text)


def _curve_sections(curves: Sequence[Curve], total: int) -> list[Section]:
    """Of as many recordings as there are curves of; `total`: all that there are."""
    stretches = stretches_for(3 * len(curves))
    recordings = list(dict.fromkeys((curve.recording, curve.role) for curve in curves))
    some = f"The {len(recordings)} of {total} recordings with the largest errors; plots/ has the others. "
    sections = []
    for place, (recording, role) in enumerate(recordings):
        plots = tuple(
            curve_plot(curve, stretches)
            for curve in curves
            if (curve.recording, curve.role) == (recording, role)
        )
        sections.append(
            Section(
                f"Torque: {recording} ({role})",
                plots,
                text=(some if len(recordings) < total else "")
                + "Drag to zoom, double-click to see all; the plots of a recording share their time axis."
                if place == 0
                else "",
                folded=place >= OPEN_RECORDINGS,
            )
        )
    return sections


def curve_plot(curve: Curve, stretches: int) -> Plot:
    """Measured and reconstructed torque with the error under them (figures 4 to 7)."""

    def trace(name: str, y: NDArray[np.float64], role: str) -> Trace:
        return Trace(name, *envelope(*with_gaps(curve.t, y), stretches), role)

    unit = readable_unit(curve.unit)
    panels = (
        Panel(
            f"torque [{unit}]",
            (trace("measured", curve.measured, "measured"), trace("reconstructed", curve.modelled, "model")),
            share=1.6,
        ),
        Panel(f"error [{unit}]", (trace("error", curve.measured - curve.modelled, "error"),), share=0.8),
    )
    caption = f"error {percent(curve.error_percent)}"
    if len(curve.t) > 2 * stretches:
        span = (curve.t[-1] - curve.t[0]) / stretches
        caption += f"; drawn: least and greatest of every {number(span, 2)} s"
    return Plot(curve.channel, "time [s]", panels, caption=caption, group=f"{curve.recording} {curve.role}")


def _test_section(document: Mapping[str, Any], histogram: Plot | None) -> Section:
    tests = document["tests"]
    rows = []
    for name, value in tests.items():
        if isinstance(value, Mapping):
            shown = ", ".join(f"{key.replace('_', ' ')} {number(item, 3)}" for key, item in value.items())
            rows.append((Cell(name.replace("_", " ")), Cell(shown)))
        elif isinstance(value, int | float):
            text = str(value) if isinstance(value, int) else number(value, 4)
            rows.append((Cell(name.replace("_", " ")), Cell(text, value)))
    table = Table("", (Column("test"), Column("result")), tuple(rows))
    return Section("Statistics", (table, *([histogram] if histogram else [])))
