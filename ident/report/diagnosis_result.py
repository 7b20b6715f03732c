"""From a `Diagnosis` to its report: the residual against what gave each effect away, and the rankings."""

import re
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ident.diagnosis import Diagnosis
from ident.diagnosis.acceptance import Step, main_channel
from ident.diagnosis.document import diagnosis_document
from ident.diagnosis.terms import Context, Term
from ident.report.diagnosis_report import ResidualView, diagnosis_page, effect_name, place
from ident.report.fit_result import channel_unit
from ident.report.page import Cell, Column, Panel, Plot, ReportPage, Section, Table, Trace
from ident.report.render import render
from ident.report.thinning import envelope, stretches_for, with_gaps
from ident.report.wording import number, readable_unit
from modelgen.effects import catalogue

Array = NDArray[np.float64]
UNITS = {"q": "rad", "dq": "rad/s", "ddq": "rad/s²", "t": "s"}


def unit_of(kind: str, joint: int, context: Context) -> str:
    """Of a signal of a joint (0-based): rad and N m, or m and N where the joint is prismatic."""
    unit = "N m" if kind == "tau_link" else UNITS.get(kind, "")
    labels = getattr(context.view.model, "prismatic", ())
    return unit.replace("rad", "m").replace("N m", "N") if str(joint + 1) in labels else unit


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
        rankings={index: ranking(step) for index, step in enumerate(steps_of(diagnosis)) if step is not None},
        about={name: about(effects[name]) for name in effects},
        warnings=tuple(document.get("notes", ())),
        details=(_runs(diagnosis),),
        extra=tuple(residual_sections(diagnosis)),
        footer=f"dynident {version('dynident')}. The numbers for programs are in diagnosis.json.",
    )


def about(effect: Any) -> str:
    """What an effect is, how it shows, who described it."""
    return f"{effect.summary.capitalize()}. In a residual: {effect.signature}. Source: {effect.source}."


def _runs(diagnosis: Diagnosis) -> str:
    rows = diagnosis.outcome.first.context.rows
    runs = [
        f"{', '.join(run.label for run in rows.runs if run.role == role)} ({role})"
        for role in ("identify", "validate", "test")
        if any(run.role == role for run in rows.runs)
    ]
    return f"Model {diagnosis.model} of {diagnosis.robot} on {', '.join(runs)}."


def steps_of(diagnosis: Diagnosis) -> tuple[Step | None, ...]:
    """The step of the loop that each finding was added in."""
    steps = {step.accepted.key: step for step in diagnosis.outcome.steps if step.accepted is not None}
    return tuple(steps.get(finding.term.key) for finding in diagnosis.findings)


def views_of(diagnosis: Diagnosis) -> tuple[ResidualView, ...]:
    """One view per finding and per unexplained structure."""
    views = []
    for index, (finding, step) in enumerate(zip(diagnosis.findings, steps_of(diagnosis), strict=True)):
        if step is not None:
            views.append(_finding_view(index, finding.term, step))
    last = diagnosis.outcome.last
    for index, rival in enumerate(diagnosis.outcome.unexplained):
        residual = last.system.residual[rival.channel].copy()
        for found in last.found:
            if found.term is None and rival.channel in found.columns:
                residual += found.columns[rival.channel] @ found.coefficients
        views.append(_unexplained_view(index, rival.channel, rival.variables, residual, last.context))
    return tuple(views)


def _finding_view(index: int, term: Term, step: Step) -> ResidualView:
    context = step.after.context
    rows, view = context.rows, context.view
    channel = term.channels[0] if len(term.channels) == 1 else main_channel(step)
    use = rows.keep[channel].copy()
    if term.run is not None:
        use &= rows.run == term.run
    name, unit, values = telling_variable(term, view.joint_of[channel], context)
    return ResidualView(
        belongs_to=("findings", index),
        channel=view.channels[channel],
        variable=name,
        variable_unit=unit,
        unit=channel_unit(view.model, view.channels[channel]),
        x=values[rows.filter.centres][use],
        before=step.before.system.residual[channel][use],
        after=step.after.system.residual[channel][use],
        forward=_forward(term, name, context, use),
    )


def _forward(term: Term, variable: str, context: Context, use: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
    """(N,) True where the joint moves forward, if the effect takes its sign and the view does not show it."""
    if term.joint is None or "sign_dq" not in term.effect.needs or variable.startswith("dq"):
        return None
    rows = context.rows
    return rows.fine.dq[rows.filter.centres, term.joint][use] > 0


def _unexplained_view(
    index: int, channel: int, variables: tuple[str, ...], residual: Array, context: Context
) -> ResidualView:
    rows, view = context.rows, context.view
    joint = view.joint_of[channel]
    name = variables[0] if variables else f"q{joint + 1}"
    kind, number_ = re.fullmatch(r"([a-z_]+)(\d*)", name).groups()  # type: ignore[union-attr]
    values = (
        rows.fine.t
        if kind == "t"
        else getattr(rows.fine, kind, rows.fine.q)[:, int(number_ or joint + 1) - 1]
    )
    use = rows.keep[channel]
    return ResidualView(
        belongs_to=("unexplained", index),
        channel=view.channels[channel],
        variable=name,
        variable_unit=unit_of(kind, int(number_ or joint + 1) - 1, context),
        unit=channel_unit(view.model, view.channels[channel]),
        x=values[rows.filter.centres][use],
        before=residual[use],
        after=None,
    )


def telling_variable(term: Term, joint: int, context: Context) -> tuple[str, str, Array]:
    """Name, unit and values (N,) at the fine rate of the signal that the effect shows itself against.

    `joint` (0-based) is that of the channel shown; an effect of the whole robot has none of its own.
    """
    fine, needs = context.rows.fine, term.effect.needs
    own = joint if term.joint is None else term.joint
    if term.effect.windowed or "t" in needs:
        return "t", "s", fine.t
    if term.source is not None and "dq_source" in needs:
        return f"dq{term.source + 1}", unit_of("dq", term.source, context), fine.dq[:, term.source]
    if "tau_link" in needs:
        return f"tau_link{own + 1}", unit_of("tau_link", own, context), context.tau_link[own]
    if "tau" in needs or "tau_source" in needs:
        source = own if term.source is None else term.source
        return f"tau_link{source + 1}", unit_of("tau_link", source, context), context.tau_link[source]
    if "q" in needs or not needs:
        return f"q{own + 1}", unit_of("q", own, context), fine.q[:, own]
    if needs & {"dq", "sign_dq", "z"}:
        return f"dq{own + 1}", unit_of("dq", own, context), fine.dq[:, own]
    return f"ddq{own + 1}", unit_of("ddq", own, context), fine.ddq[:, own]


def ranking(step: Step) -> Table:
    """The candidates of one step, best first, with what each would gain on fitted and on held-out rows."""
    rows = []
    for candidate in sorted(step.ranking, key=lambda item: -item.total):
        term, score = candidate.term, candidate.score
        joints = () if term.joint is None else (term.joint + 1,)
        chosen = step.accepted is not None and term.key == step.accepted.key
        rows.append(
            (
                Cell(effect_name(term.effect.name)),
                Cell(place(joints) + (f", from joint {term.source + 1}" if term.source is not None else "")),
                Cell(number(score.identify, 3), score.identify),
                Cell(number(score.held_out, 3), score.held_out, "" if score.held_out > 0 else "bad"),
                Cell("chosen" if chosen else "", tone="good"),
            )
        )
    columns = (
        Column("candidate"),
        Column("where"),
        Column("gain, fitted", True, help="log-likelihood on the rows that were fitted"),
        Column("gain, held out", True, help="the same with everything frozen, on rows that were not fitted"),
        Column(""),
    )
    return Table("Ranking of the candidates", columns, tuple(rows), caption="Gains in log-likelihood.")


def residual_sections(diagnosis: Diagnosis) -> list[Section]:
    """The residual over time, before and after, run by run."""
    first, last = diagnosis.outcome.first, diagnosis.outcome.last
    rows = first.context.rows
    stretches = stretches_for(2 * len(rows.channels) * len(rows.runs), 1_500_000)
    sections = []
    for index, run in enumerate(rows.runs):
        plots = []
        for channel, name in enumerate(rows.channels):
            use = (rows.run == index) & rows.keep[channel]
            unit = readable_unit(channel_unit(first.context.view.model, name))
            panels = tuple(
                Panel(
                    f"{title} [{unit}]",
                    (
                        Trace(
                            title,
                            *envelope(
                                *with_gaps(rows.t[use], state.system.residual[channel][use]), stretches
                            ),
                            title,
                        ),
                    ),
                    share=0.8,
                )
                for title, state in (("before", first), ("after", last))
            )
            plots.append(Plot(name, "time [s]", panels, group=run.label, same_scale=True))
        sections.append(Section(f"Residual over time: {run.label} ({run.role})", tuple(plots), folded=True))
    return sections
