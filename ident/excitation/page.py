"""An experiment as a page and as a stick figure that moves. Nothing is designed here."""

from __future__ import annotations

import json
import math
from html import escape
from pathlib import Path

import numpy as np

from ident.excitation.experiment import Experiment
from ident.excitation.sensitivity import Visible
from ident.report.page import Cell, Column, Fact, Panel, Plot, Remark, ReportPage, Section, Table, Trace
from modelgen.effects.frames import frames

FRAMES_HZ = 25.0
DRAWN = 1500  # samples of a curve


def page(done: Experiment) -> ReportPage:
    """Motion, expected deviations, what is separated, what would be seen."""
    facts = [
        Fact(f"{done.condition:.3g}", "scaled condition number"),
        Fact(f"{done.seconds:.4g} s", "motion"),
    ]
    if done.separated is not None and math.isfinite(done.separated.seconds):
        facts.append(Fact(f"{done.separated.seconds:.3g} s", "for a decision right in 99 of 100"))
    sections = [*_motion(done), _parameters(done)]
    if done.visible:
        sections.append(_visible(done))
    verdict = done.separated.sentence if done.separated else _verdict(done)
    return ReportPage(
        title=f"Experiment for {done.robot.name}",
        kind="Experiment",
        verdict=verdict,
        tone="plain",
        sections=tuple(sections),
        facts=tuple(facts),
        checks=tuple(Remark(text, False) for text in done.remarks),
    )


def _verdict(done: Experiment) -> str:
    valued = done.known.chi != 0
    good, count = int((done.percent < 10).sum()), int(valued.sum())
    told = f"{good} of {count} base parameters are expected within 10 per cent of their values"
    return (
        f"{told}; {len(valued) - count} are zero in a robot like this one."
        if count < len(valued)
        else f"{told}."
    )


def _motion(done: Experiment) -> list[Section]:
    if done.optimum is None:
        return []
    t = np.linspace(0.0, done.motion.period, DRAWN)  # type: ignore[union-attr]
    units = ("q in rad", "dq in rad/s", "ddq in rad/s²")
    panels = []
    for unit, values in zip(units, done.motion.states(t)):  # type: ignore[union-attr]
        traces = tuple(
            Trace(f"joint {label}", t, values[:, k], "measured") for k, label in enumerate(done.bounds.labels)
        )
        panels.append(Panel(unit.replace("rad", "m") if all(done.bounds.slides) else unit, traces))
    told = f"Largest use of a limit: {100 * done.largest_use[0]:.1f} % of {done.largest_use[1]}."
    return [Section("Motion", (Plot("One period", "t in s", tuple(panels)),), told)]


def _parameters(done: Experiment) -> Section:
    columns = (Column("parameter"), *(Column(name, number=True) for name in ("value", "expected std", "%")))
    rows = []
    for name, value, std, percent in zip(done.names, done.known.chi, done.std, done.percent):
        shown = f"{percent:.3g}" if math.isfinite(percent) else ""
        rows.append((Cell(name), *(_number(x) for x in (value, std)), Cell(shown, float(percent))))
    return Section("Expected standard deviations", (Table("", columns, tuple(rows)),))


def _visible(done: Experiment) -> Section:
    columns = (
        Column("effect"),
        Column("joint"),
        Column("smallest visible size"),
        Column("% of torque", True),
    )
    rows = []
    for its in done.visible:
        told = its.told if its.values is not None else "is not expected to show"
        rows.append((Cell(its.effect), Cell(", ".join(its.joints)), Cell(told), _share(its)))
    text = (
        "Sizes that this motion shows with 95 % power at the noise assumed, at usual shapes of the effects."
    )
    return Section("What would be seen", (_map(done), Table("", columns, tuple(rows))), text)


def _map(done: Experiment) -> Table:
    """Effects by joints: per cent of the joint's torque from which on an effect shows."""
    labels = done.bounds.labels
    by_place = {(its.effect, its.joints[0]): its for its in done.visible if len(its.joints) == 1}
    columns = (Column("effect"), *(Column(f"joint {label}", number=True) for label in labels))
    rows = tuple(
        (Cell(name), *(_share(by_place.get((name, label))) for label in labels))
        for name in dict.fromkeys(name for name, _ in by_place)
    )
    return Table("% of the joint's torque that shows", columns, rows)


def _share(its: Visible | None) -> Cell:
    if its is None or its.values is None:
        return Cell("", math.inf)
    tone = "good" if its.share < 0.01 else "" if its.share < 0.05 else "bad"
    return Cell(f"{100 * its.share:.2g}", its.share, tone)


def _number(value: float) -> Cell:
    return Cell(f"{value:.4g}", float(value))


def stick_figure(done: Experiment) -> str:
    """An HTML page without network: the chain of frame origins, seen from the side and from above."""
    t = np.arange(0.0, done.motion.period, 1 / FRAMES_HZ)  # type: ignore[union-attr]
    q = done.motion.states(t)[0]  # type: ignore[union-attr]
    origins = frames(done.robot, q).p  # (N, rows, 3)
    links = [[link.antecedent - 1, row] for row, link in enumerate(done.robot.links)]
    data = {"links": links, "p": np.round(origins, 3).tolist(), "hz": FRAMES_HZ}
    template = (Path(__file__).parent / "stick_figure.html").read_text(encoding="utf-8")
    return template.replace("DATA", json.dumps(data, separators=(",", ":"))).replace(
        "TITLE", escape(done.robot.name)
    )
