"""The report of a diagnosis, from `diagnosis.json` and the residuals behind it. Only texts are made here."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ident.report.fit_report import remarks
from ident.report.page import Block, Cell, Column, Fact, Panel, Plot, ReportPage, Section, Table, Trace
from ident.report.wording import joined, number, percent, readable_unit, with_deviation

POINTS = 1500  # drawn of a residual against a variable; the curve of medians is over all of them
BINS = 60
FIRST = 3  # sentences above the fold; each finding has its own in its section
CLOSE = 0.8  # of a finding's error drop: a rival is named in its sentence
WORSE = 2.0  # times the error of the fitted runs: these do not determine the model


@dataclass(frozen=True, slots=True)
class ResidualView:
    """A channel's residual against the variable that gave an effect away, before and after it was added.

    Shapes: x, before, after (N,); `after` may be None where nothing was added. `belongs_to` is
    ("findings" | "unexplained", index in diagnosis.json). `forward` (N,) parts the samples by the sign of the
    joint's rate where the effect does.
    """

    belongs_to: tuple[str, int]
    channel: str
    variable: str
    variable_unit: str
    unit: str
    x: NDArray[np.float64]
    before: NDArray[np.float64]
    after: NDArray[np.float64] | None
    forward: NDArray[np.bool_] | None = None

    def medians(
        self, residual: NDArray[np.float64]
    ) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Curves of medians by name: one, or one for each direction of motion."""
        if self.forward is None:
            return {"median": binned_median(self.x, residual)}
        return {
            "median, dq > 0": binned_median(self.x[self.forward], residual[self.forward]),
            "median, dq < 0": binned_median(self.x[~self.forward], residual[~self.forward]),
        }


def effect_name(name: str) -> str:
    return name.replace("_", " ")


def place(joints: Sequence[int]) -> str:
    """`joint 4`, `joints 2 and 3`, `the whole robot`."""
    if not joints:
        return "the whole robot"
    return f"joint{'s' if len(joints) > 1 else ''} {joined([str(joint) for joint in joints])}"


def verdict(document: Mapping[str, Any]) -> str:
    """The diagnosis in a sentence or two that an engineer can act on."""
    findings, unexplained = document["findings"], document["unexplained"]
    sentences = []
    if findings:
        sentences.append(f"The model lacks {_what_is_missing(findings)}.")
    if unexplained:
        where = joined([f"{place(item['joints'])} ({item['channel']})" for item in unexplained])
        opening = "Structure is left that" if findings else "There is structure in the residual that"
        sentences.append(f"{opening} no known effect explains, on {where}.")
    if not sentences:
        sentences.append("The model lacks nothing that these recordings show: what is left looks like noise.")
    return " ".join([*sentences, *_worse_elsewhere(document)])


def _worse_elsewhere(document: Mapping[str, Any]) -> list[str]:
    """A warning where runs that were not fitted have a much larger error than those that were."""
    after, role = document["error_percent"]["after"], _held_out(document)
    if role == "identify" or after[role]["total"] < WORSE * after["identify"]["total"]:
        return []
    ratio = after[role]["total"] / max(after["identify"]["total"], 1e-9)
    return [
        f"The error on {role} runs is {ratio:.1f} times that of the fitted ones: these do not show all that "
        "the robot does there; fit longer, faster or more varied motion."
    ]


def _what_is_missing(findings: Sequence[Mapping[str, Any]], most: int = 3) -> str:
    """The effects, strongest first, each with all its joints; no more than `most` of them by name."""
    joints: dict[str, list[int]] = {}
    for item in findings:
        joints.setdefault(item["effect"], []).extend(item["joints"])
    named = [f"{effect_name(name)} on {place(sorted(set(numbers)))}" for name, numbers in joints.items()]
    if len(named) > most:
        named = [
            *named[:most],
            f"{len(named) - most} more effects" if len(named) > most + 1 else "one more effect",
        ]
    return joined(named)


def finding_sentence(document: Mapping[str, Any], finding: Mapping[str, Any]) -> str:
    """`Joint 4: stribeck friction, Fs = 3.1 ± 0.1 N m; tau_m4 on test 5.0 % -> 2.1 %; noise floor 1.8 %.`"""
    values = []
    for name, item in finding["parameters"].items():
        value = item["value"]
        if isinstance(value, str):
            values.append(f"{name} {value}")
        elif name == "source_joint":
            values.append(f"from joint {int(value)}")
        else:
            values.append(f"{name} = {with_deviation(value, item.get('std') or 0.0, item.get('unit') or '')}")
    text = f"{place(finding['joints']).capitalize()}: {effect_name(finding['effect'])}"
    if values:
        text += f", {', '.join(values)}"
    text += _error_in_words(document, finding)
    rivals = close_rivals(finding)
    if rivals:
        named = [f"{effect_name(rival['effect'])} on {place(rival['joints'])}" for rival in rivals[:3]]
        text += f". Nearly as good on these runs: {joined(named)}"
    return text + "."


def close_rivals(finding: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Alternatives in the same place that would lower the error by at least `CLOSE` of what the finding does.

    In the same place: on one of its joints, or one of the two concerns the whole robot. A candidate
    elsewhere is not an alternative but another thing to find.
    """
    own = finding["evidence"].get("error_drop_percent") or 0.0
    joints = set(finding["joints"])
    return [
        rival
        for rival in finding.get("alternatives") or []
        if (rival["error_drop_percent"] or 0.0) >= CLOSE * own
        and (not joints or not rival["joints"] or joints & set(rival["joints"]))
    ]


def _error_in_words(document: Mapping[str, Any], finding: Mapping[str, Any]) -> str:
    """Error of the finding's own channel on the runs that were used least, else the drop on adding it."""
    before, after = document["error_percent"]["before"], document["error_percent"]["after"]
    role = _held_out(document)
    channel = f"{finding['channel']}{finding['joints'][0]}" if finding["joints"] else ""
    if channel in before[role]:
        text = f"; error of {channel} on {role} runs {percent(before[role][channel])} → "
        text += percent(after[role][channel])
        floor = document.get("noise_floor_percent", {}).get(channel)
        return text if floor is None else f"{text}, noise floor {percent(floor)}"
    drop = finding["evidence"].get("error_drop_percent")
    return "" if drop is None else f"; it lowered the error by {percent(drop)}"


def unexplained_sentence(item: Mapping[str, Any]) -> str:
    depends = joined(list(item["depends_on"])) or "nothing that was measured"
    share = percent(item["share_of_residual_percent"])
    return (
        f"{place(item['joints']).capitalize()}, {item['channel']}: {share} of the residual depends on "
        f"{depends}, and no effect of the catalogue has that shape."
    )


def regenerated_sentence(document: Mapping[str, Any]) -> str:
    """`Model with stribeck_friction:2 regenerated in model/.`, and what is not in its C; "" if nothing is."""
    made = document.get("regenerated") or {}
    effects, left = made.get("effects") or [], made.get("not_columns") or []
    out = f"Model with {joined(effects)} regenerated in model/" if effects else ""
    if left:
        named = "; ".join(f"{effect_name(n['effect'])} on {place(n['joints'])} {n['reason']}" for n in left)
        out += f"; not part of its C: {named}" if out else f"No model regenerated: {named}"
    return f"{out}." if out else ""


def told(document: Mapping[str, Any]) -> list[str]:
    """A sentence for each finding, then for each unexplained structure."""
    return [finding_sentence(document, finding) for finding in document["findings"]] + [
        unexplained_sentence(item) for item in document["unexplained"]
    ]


def before_and_after(document: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of the error table: per channel before and after for each role, and the noise floor."""
    before, after = document["error_percent"]["before"], document["error_percent"]["after"]
    floor = document["noise_floor_percent"]
    header = (
        "channel",
        *(f"{role} {when}" for role in before for when in ("before", "after")),
        "noise floor",
    )
    rows = []
    for channel in next(iter(before.values())):
        values = [f"{block[role][channel]:.2f}" for role in before for block in (before, after)]
        rows.append((channel, *values, f"{floor[channel]:.2f}" if channel in floor else ""))
    return header, rows


def diagnosis_page(
    document: Mapping[str, Any],
    title: str,
    views: Sequence[ResidualView] = (),
    rankings: Mapping[int, Table] | None = None,
    about: Mapping[str, str] | None = None,
    warnings: Sequence[str] = (),
    details: Sequence[str] = (),
    extra: Sequence[Section] = (),
    footer: str = "",
) -> ReportPage:
    """Verdict, error before and after, then each finding with the residual that gave it away.

    `rankings`: a table of candidates for a finding, by its index; `about`: a sentence on an effect, by name.
    """
    said = told(document)
    if len(said) > FIRST + 1:
        said = [*said[:FIRST], f"{len(said) - FIRST} more below."]
    details = (*filter(None, [regenerated_sentence(document)]), *details)
    sections = [error_section(document)]
    for number_ in range(len(document["findings"])):
        sections.append(_finding_section(document, number_, views, rankings or {}, about or {}))
    for number_, item in enumerate(document["unexplained"]):
        blocks = tuple(_view_plot(view) for view in views if view.belongs_to == ("unexplained", number_))
        heading = f"Unexplained: {place(item['joints'])}, {item['channel']}"
        sections.append(Section(heading, blocks, text=unexplained_sentence(item)))
    return ReportPage(
        title=title,
        kind="Diagnosis",
        verdict=verdict(document),
        tone={"effect": "good", "none": "good"}.get(document["verdict"], "bad"),
        checks=remarks(document),
        warnings=tuple(warnings),
        details=(*said, *details),
        facts=tuple(_facts(document)),
        sections=(*sections, *extra),
        footer=footer,
    )


def _held_out(document: Mapping[str, Any]) -> str:
    before = document["error_percent"]["before"]
    return next((role for role in ("test", "validate") if role in before), "identify")


def _facts(document: Mapping[str, Any]) -> list[Fact]:
    facts = []
    before, after = document["error_percent"]["before"], document["error_percent"]["after"]
    for role in before:
        first, last = before[role]["total"], after[role]["total"]
        better = "good" if last < 0.98 * first else "bad" if last > 1.02 * first else ""
        facts.append(
            Fact(f"{percent(first)} → {percent(last)}", f"error on {role} runs, all channels", better)
        )
    return facts


def error_section(document: Mapping[str, Any]) -> Section:
    before, after = document["error_percent"]["before"], document["error_percent"]["after"]
    floor = document.get("noise_floor_percent", {})
    columns = [Column("channel")]
    for role in before:
        columns += [
            Column(f"{role}, before", number=True),
            Column(f"{role}, after", number=True, help="with the effects found, fitted again"),
        ]
    columns.append(Column("noise floor", number=True, help="an upper bound, from the band above the motion"))
    rows = []
    for channel in next(iter(before.values())):
        cells = [Cell("all channels" if channel == "total" else channel)]
        for role in before:
            first, last = before[role].get(channel), after[role].get(channel)
            cells.append(Cell(percent(first), first if first is not None else ""))
            tone = ""
            if first and last is not None:
                tone = "good" if last < 0.95 * first else "bad" if last > 1.05 * first else ""
            cells.append(Cell(percent(last), last if last is not None else "", tone))
        cells.append(Cell(percent(floor.get(channel)), floor.get(channel, ""), "faint"))
        rows.append(tuple(cells))
    text = (
        "At the full filtered rate, on the same rows before and after. "
        + {
            "test": "Test runs were used neither for the fit nor to choose what is kept.",
            "validate": "Validate runs were not fitted; they decided what is kept.",
            "identify": "No run was kept apart; runs or blocks left out in turn decided what is kept.",
        }[_held_out(document)]
    )
    return Section("Error before and after", (Table("", tuple(columns), tuple(rows)),), text=text)


def _finding_section(
    document: Mapping[str, Any],
    index: int,
    views: Sequence[ResidualView],
    rankings: Mapping[int, Table],
    about: Mapping[str, str],
) -> Section:
    finding = document["findings"][index]
    rows = []
    for name, item in finding["parameters"].items():
        value, std = item["value"], item.get("std")
        shown = value if isinstance(value, str) else number(value)
        rows.append(
            (
                Cell(name),
                Cell(shown, value),
                Cell(number(std, 2), std if std is not None else ""),
                Cell(readable_unit(item.get("unit") or "")),
            )
        )
    blocks: list[Block] = [_view_plot(view) for view in views if view.belongs_to == ("findings", index)]
    columns = (Column("parameter"), Column("value", True), Column("σ", True), Column("unit"))
    blocks.append(Table("Parameters of the effect", columns, tuple(rows)))
    blocks.append(rankings.get(index) or _alternatives(finding))
    title = f"{index + 1}. {effect_name(finding['effect']).capitalize()}, {place(finding['joints'])}"
    p_value = finding["evidence"].get("p_value")
    text = f"{finding_sentence(document, finding)} {about.get(finding['effect'], '')}"
    if p_value is not None:
        p = "p < 1e-300" if p_value == 0 else f"p = {number(p_value, 2)}"
        text = f"{text} {p}."
    return Section(title, tuple(blocks), text=text.strip())


def _alternatives(finding: Mapping[str, Any]) -> Table:
    """Candidates that explain nearly the same, from diagnosis.json alone."""
    ranking = [
        (finding["effect"], finding["joints"], finding["evidence"].get("error_drop_percent"), "chosen")
    ]
    for rival in finding.get("alternatives") or []:
        ranking.append((rival["effect"], rival["joints"], rival.get("error_drop_percent"), ""))
    rows = [
        (
            Cell(effect_name(effect)),
            Cell(place(joints)),
            Cell(percent(drop), drop or 0.0),
            Cell(note, tone="good"),
        )
        for effect, joints, drop, note in ranking
    ]
    columns = (Column("candidate"), Column("where"), Column("error drop", True), Column(""))
    return Table("Ranking of the candidates", columns, tuple(rows))


def _view_plot(view: ResidualView) -> Plot:
    """Before above after on one scale: some samples as points, the median of every bin as a line."""
    unit = readable_unit(view.unit)
    states = [("before", view.before, "before")]
    if view.after is not None:
        states.append(("after", view.after, "after"))
    step = max(len(view.x) // POINTS, 1)
    panels = []
    for name, residual, role in states:
        dashes = ("solid", "dash")
        curves = zip(view.medians(residual).items(), dashes, strict=False)
        traces = (
            Trace(name, view.x[::step], residual[::step], role, kind="points"),
            *(Trace(label, x, y, "error", dash=dash) for (label, (x, y)), dash in curves),
        )
        panels.append(Panel(f"{name} [{unit}]", traces, share=1.1))
    label = f"{view.variable} [{readable_unit(view.variable_unit)}]"
    return Plot(f"Residual of {view.channel} against {view.variable}", label, tuple(panels), same_scale=True)


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
