"""The page of a diagnosis, from `diagnosis.json` and its pictures. Only texts and tables are made here."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ident.report.finding_words import (
    effect_name,
    evidence_in_words,
    finding_sentence,
    held_out,
    mind_in_words,
    place,
    rivals_in_words,
    sides_in_words,
    visible_in_words,
    visible_size,
    where,
)
from ident.report.fit_report import remarks
from ident.report.page import Block, Cell, Column, Fact, Panel, Plot, ReportPage, Section, Table, Trace
from ident.report.unexplained_words import unexplained_sentence
from ident.report.verdict_words import left_in_words, told, verdict
from ident.report.wording import number, percent, readable_unit, shares_rows

BINS = 60
FIRST = 3  # sentences above the fold; each finding has its own in its section
SMOOTH = 0.1  # of an effect's variance off its curve over x: up to here it is drawn as a line
SIGMAS = 1.96  # of a 95 % interval
ROLES = {
    "test": "Test runs were used neither for the fit nor to choose what is kept.",
    "validate": "Validate runs were not fitted; they decided what is kept.",
    "identify": "No run was kept apart; runs or stretches left out in turn decided what is kept.",
}
SHARED = {
    "test": "Rows of test runs were used before, to fit or to choose: their errors show no more.",
    "validate": "Rows of validate runs were fitted, too, and decided what is kept: look at other runs.",
}


@dataclass(frozen=True, slots=True)
class View:
    """What gave a finding away: x, before, effect (N,): the signal, the torque that the model without it
    leaves, its own torque (zeros where there is none). `belongs_to`: ("findings" | "unexplained", index)."""

    belongs_to: tuple[str, int]
    channel: str
    variable: str
    variable_unit: str
    unit: str
    x: NDArray[np.float64]
    before: NDArray[np.float64]
    effect: NDArray[np.float64]

    @property
    def curve(self) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
        """The effect over x: a curve of medians where it is nearly a function of x, else as it is."""
        x, y = binned_median(self.x, self.effect)
        rest = self.effect - np.interp(self.x, x, y)
        if np.var(rest) <= SMOOTH * np.var(self.effect):
            return x, y, True
        return self.x, self.effect, False

    @property
    def has_effect(self) -> bool:
        return bool(np.any(self.effect))


def diagnosis_page(
    document: Mapping[str, Any],
    title: str,
    views: Sequence[View] = (),
    about: Mapping[str, Sequence[str]] | None = None,
    programs: Mapping[int, str] | None = None,
    warnings: Sequence[str] = (),
    details: Sequence[str] = (),
    footer: str = "",
) -> ReportPage:
    """Checks, verdict, errors before and after, then a section for each finding and each unexplained joint.

    about: (summary, signature, source) of an effect by name; programs: how a finding becomes C, by index.
    """
    said = told(document)
    if len(said) > FIRST + 1:
        said = [*said[:FIRST], f"{len(said) - FIRST} more below."]
    if document["verdict"] != "none":
        said.append(left_in_words(document))
    sections = [error_section(document)]
    for k in range(len(document["findings"])):
        sections.append(_finding_section(document, k, views, about or {}, programs or {}))
    for k, item in enumerate(document["unexplained"]):
        blocks = tuple(_plot(view) for view in views if view.belongs_to == ("unexplained", k))
        heading = f"Unexplained: {place(item['joints'])}, {item['channel']}"
        sections.append(Section(heading, (*blocks, _unexplained_table(document, item))))
    if document.get("smallest_visible"):
        sections.append(_visible_section(document))
    if notes := document.get("notes"):
        rows = tuple((Cell(note),) for note in notes)
        table = Table("", (Column("what was found, dropped or changed"),), rows)
        sections.append(Section("Notes on the recordings", (table,), folded=True))
    return ReportPage(
        title=title,
        kind="Diagnosis",
        verdict=verdict(document),
        tone={"effect": "good", "none": "plain"}.get(document["verdict"], "bad"),
        checks=remarks(document),
        warnings=tuple(warnings),
        details=(*said, *details),
        facts=tuple(_facts(document)),
        sections=tuple(sections),
        footer=footer,
    )


def _visible_section(document: Mapping[str, Any]) -> Section:
    columns = (
        Column("effect"),
        Column("joint"),
        Column("smallest size that would have been seen"),
        Column("% of the joint's torque", number=True),
    )
    rows = []
    for its in sorted(document["smallest_visible"], key=lambda its: (its["effect"], its["joints"])):
        source = its.get("source_joint")
        where = f"{its['joints'][0]}" + (f", from {source}" if source is not None else "")
        tone = "good" if its["share"] < 0.01 else "" if its["share"] < 0.05 else "bad"
        share = Cell(number(100 * its["share"], 2), its["share"], tone)
        rows.append((Cell(effect_name(its["effect"])), Cell(where), Cell(visible_size(its)), share))
    heading = "What would have been seen"
    return Section(heading, (Table("", columns, tuple(rows)),), visible_in_words(document), folded=True)


def _facts(document: Mapping[str, Any]) -> list[Fact]:
    before, after = document["error_percent"]["before"], document["error_percent"]["after"]
    return [
        Fact(
            f"{percent(before[role]['total'])} → {percent(after[role]['total'])}",
            f"error on {role} runs, all channels",
            _tone(before[role]["total"], after[role]["total"]),
        )
        for role in before
    ]


def _tone(first: float | None, last: float | None) -> str:
    if not first or last is None:
        return ""
    return "good" if last < 0.98 * first else "bad" if last > 1.02 * first else ""


def error_section(document: Mapping[str, Any]) -> Section:
    """Per role and channel, before and after, and the noise floor; what of the explainable has a name."""
    before, after = document["error_percent"]["before"], document["error_percent"]["after"]
    floor, white = document.get("noise_floor_percent", {}), document.get("white_noise_percent", {})
    columns = [Column("channel")]
    for role in before:
        columns += [
            Column(f"{role}, before", number=True),
            Column(f"{role}, after", number=True, help="with the effects found, fitted again"),
        ]
    columns += [
        Column("noise floor", number=True, help="what neither an effect nor a nameless function explains"),
        Column(
            "white noise",
            number=True,
            help="of it, read above the band of the motion, or what no past foretells",
        ),
    ]
    rows = []
    for channel in next(iter(before.values())):
        cells = [Cell("all channels" if channel == "total" else channel)]
        for role in before:
            first, last = before[role].get(channel), after[role].get(channel)
            cells.append(Cell(percent(first), first if first is not None else ""))
            cells.append(Cell(percent(last), last if last is not None else "", _tone(first, last)))
        cells += [Cell(percent(its.get(channel)), its.get(channel, ""), "faint") for its in (floor, white)]
        rows.append(tuple(cells))
    role = held_out(document)
    shared = shares_rows(document, document.get("uses") or {}, role)
    text = (
        f"At the full filtered rate, on the same rows before and after. {(SHARED if shared else ROLES)[role]}"
    )
    tables = (Table("", tuple(columns), tuple(rows)), *_explained(document))
    return Section("Error before and after", tables, text=text)


def _explained(document: Mapping[str, Any]) -> tuple[Table, ...]:
    """What of the explainable has a name, of channels where more than chance is to be explained."""
    asked = (document.get("judged") or {}).get("log_e_asked") or 0.0
    rows = tuple(
        (
            Cell(channel),
            Cell(percent(its["explained_share_percent"]), its["explained_share_percent"]),
            Cell(number(its["explainable_nats"], 3), its["explainable_nats"]),
        )
        for channel, its in document.get("explainable", {}).items()
        if its["explainable_nats"] > asked
    )
    columns = (
        Column("channel"),
        Column("has a name", number=True),
        Column("explainable [nats]", number=True),
    )
    return (Table("What could be explained", columns, rows),) if rows else ()


def _finding_section(
    document: Mapping[str, Any],
    index: int,
    views: Sequence[View],
    about: Mapping[str, Sequence[str]],
    programs: Mapping[int, str],
) -> Section:
    finding = document["findings"][index]
    summary, signature, source = about.get(finding["effect"], ("", "", ""))
    shown = f"{finding.get('signature') or signature}"
    facts = [
        ("Where", where(finding)),
        ("What it is", summary),
        ("What showed it", shown),
        ("What to do", (finding.get("remedy") or "") + programs.get(index, "")),
        ("What these data cannot reject instead", rivals_in_words(finding)),
        ("What speaks for it", evidence_in_words(document, finding)),
        ("What would change our mind", mind_in_words(finding)),
        ("Source", source),
    ]
    blocks: list[Block] = [_plot(view) for view in views if view.belongs_to == ("findings", index)]
    blocks += [_facts_table(facts), *_parameters(finding)]
    grade = f" ({finding['grade']})" if finding.get("grade") else ""
    title = f"{index + 1}. {effect_name(finding['effect']).capitalize()}, {place(finding['joints'])}{grade}"
    return Section(title, tuple(blocks), text=finding_sentence(document, finding))


def _facts_table(facts: Sequence[tuple[str, str]]) -> Table:
    rows = tuple((Cell(name), Cell(text, tone="wide")) for name, text in facts if text)
    return Table("", (Column(""), Column("")), rows)


def _parameters(finding: Mapping[str, Any]) -> tuple[Table, ...]:
    """Values with 95 % intervals; a search that ended at its bound has none."""
    rows = []
    for name, its in finding["parameters"].items():
        value, std = its["value"], its.get("std")
        word = isinstance(value, str) or value is None
        interval = (
            f"{number(value - SIGMAS * std)} to {number(value + SIGMAS * std)}" if std and not word else ""
        )
        note = "the end of the searched range: a bound, not an estimate" if its.get("at_bound") else ""
        rows.append(
            (
                Cell(name),
                Cell(str(value or "") if word else number(value), "" if value is None else value),
                Cell(number(std, 2) if std else "", std if std else ""),
                Cell(interval),
                Cell(readable_unit(its.get("unit") or "")),
                Cell(note),
            )
        )
    titles = (Column("parameter"), Column("value", True), Column("σ", True), Column("95 % interval"))
    return (Table("Parameters", (*titles, Column("unit"), Column("")), tuple(rows)),) if rows else ()


def _unexplained_table(document: Mapping[str, Any], item: Mapping[str, Any]) -> Table:
    asked = (document.get("judged") or {}).get("log_e_asked")
    evidence = f"log E = {number(item['log_e'], 3)} of a function without a name" if item.get("log_e") else ""
    return _facts_table(
        [
            ("What is left", unexplained_sentence(item, sides_in_words(document))),
            (
                "What speaks for it",
                f"{evidence}; {number(asked, 2)} is asked." if evidence and asked else evidence,
            ),
            (
                "What to do",
                "Record these signals over their whole range; an effect of that shape can be added in "
                "one file (effects_folder).",
            ),
        ]
    )


def _plot(view: View) -> Plot:
    """The residual without the effect, its torque through it; below what is left, on the same scale."""
    unit = readable_unit(view.unit)
    label = f"{view.variable} [{readable_unit(view.variable_unit)}]"
    title = f"Residual of {view.channel} against {view.variable}"
    points = Trace("left without it", view.x, view.before, "before", kind="points")
    if not view.has_effect:
        median = Trace("median", *binned_median(view.x, view.before), "error")
        return Plot(title, label, (Panel(f"left [{unit}]", (points, median), share=1.3),))
    x, y, smooth = view.curve
    curve = Trace("its own torque", x, y, "error", kind="line" if smooth else "points")
    rest = view.before - view.effect
    left = (
        Trace("left with it", view.x, rest, "after", kind="points"),
        Trace("median", *binned_median(view.x, rest), "error", dash="dash"),
    )
    panels = (Panel(f"without it [{unit}]", (points, curve), 1.3), Panel(f"with it [{unit}]", left, 0.9))
    return Plot(title, label, panels, same_scale=True)


def binned_median(
    x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Medians of y over `BINS` stretches of x that hold equally many samples. Shapes (N,) -> (<= BINS,)."""
    order = np.argsort(x, kind="stable")
    groups = [group for group in np.array_split(order, BINS) if len(group)]
    return (
        np.array([np.median(x[group]) for group in groups]),
        np.array([np.median(y[group]) for group in groups]),
    )
