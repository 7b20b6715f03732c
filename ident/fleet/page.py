"""The report page of a fleet: what changed, three robots to look at first and why, joint by joint."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from ident.fleet.charts import delay
from ident.fleet.fleet import Fleet
from ident.fleet.trends import ALARM, WATCH, Trends
from ident.report.page import Cell, Column, Fact, Panel, Plot, ReportPage, Section, Table, Trace

FIRST = 3
DRAWN = 40  # robots drawn beside those that changed


def page(fleet: Fleet) -> ReportPage:
    """The whole page; nothing is computed but texts."""
    found = fleet.trends
    alarms = [c for c in found.changes if c.level == "alarm"] if found else []
    named = len({change.robot for change in alarms})
    verdict = f"{named} of {len(fleet.robots)} robots changed." if named else "No robot changed beyond doubt."
    sections = [_first(found), *_joints(found), _odd(found)] if found else []
    return ReportPage(
        title=f"{len(fleet.robots)} robots, {len(fleet.jobs)} recordings",
        kind="Fleet",
        verdict=verdict,
        tone="bad" if named else "good",
        facts=(
            Fact(str(len(fleet.robots)), "robots"),
            Fact(str(len(fleet.summaries)), "recordings used"),
            Fact(str(len(fleet.reasons)), "recordings not used", "bad" if fleet.reasons else ""),
        ),
        details=(rates(found),) if found else (),
        sections=(*sections, _table(fleet), *_broken(fleet)),
        footer=f"dynident {version('dynident')}. Numbers for programs are in fleet.parquet beside this file.",
    )


def rates(found: Trends) -> str:
    """The false alarms that the thresholds stand for, and how late they see a step."""
    late = [f"{delay(limit, 1):.0f} or {delay(limit, 2):.0f}" for limit in (found.alarm, found.watch)]
    return (
        f"A change is an alarm at {ALARM:g} false alarms in a year of the whole fleet, and worth a look at "
        f"{WATCH:g} in a robot-year, for {found.a_year:.0f} observations of a robot in a year. A joint whose "
        "friction steps by one or two standard deviations of an observation, after a long quiet past, is an "
        f"alarm after {late[0]} observations in the mean and worth a look after {late[1]}."
    )


def _first(found: Trends) -> Section:
    told = list({change.robot: change for change in reversed(found.changes)}.values())[::-1]
    columns = (Column("robot"), Column("joint"), Column("level"), Column("why"))
    rows = [
        (Cell(c.robot), Cell(c.joint), Cell(c.level, tone="bad" * (c.level == "alarm")), Cell(c.sentence()))
        for c in told[:FIRST]
    ]
    text = "" if rows else "No chart of any robot stands above its threshold."
    blocks = (Table("", columns, tuple(rows)),) if rows else ()
    return Section("Look at these first", blocks, text)


def _joints(found: Trends) -> list[Section]:
    x = np.arange(len(found.days), dtype=float)
    changed = {(c.robot, c.joint) for c in found.changes if c.level == "alarm"}
    plots = []
    for j, joint in enumerate(found.joints):
        its = found.friction[:, :, j]
        if not np.isfinite(its).any():
            continue
        loud = [r for r, robot in enumerate(found.robots) if (robot, joint) in changed]
        quiet = [r for r in range(len(found.robots)) if r not in loud][:DRAWN]
        lines = [Trace(found.robots[r], x, its[r], "reference") for r in quiet]
        lines += [Trace(found.robots[r], x, its[r], "error") for r in loud]
        levels = [Trace(t.name, x, found.level[found.robots.index(t.name), :, j], t.role) for t in lines]
        plots.append(
            Plot(
                f"Joint {joint}",
                "observation",
                (Panel("friction [N m]", tuple(lines)), Panel("chart / alarm", tuple(levels))),
                group="days",
            )
        )
    text = (
        "Friction at the joint's usual speed, and the chart that judges it; 1 is the threshold of an alarm."
    )
    return [Section("Joint by joint", tuple(plots), text)]


def _odd(found: Trends) -> Section:
    columns = (Column("robot"), Column("joint"), Column("robust deviations", True))
    rows = [(Cell(r), Cell(j), Cell(f"{far:+.1f}", far)) for r, j, far in found.odd]
    text = "Joints that rub otherwise than the same joint of the other robots, from the first day on."
    return Section("Unlike its sisters", (Table("", columns, tuple(rows)),) if rows else (), text, not rows)


def _table(fleet: Fleet) -> Section:
    columns = (
        *(Column("robot"), Column("recordings", True), Column("last error", True)),
        *(Column("change"), Column("findings on the last recording")),
    )
    rows = []
    for robot in fleet.robots:
        jobs = [job for job in fleet.jobs if job.robot == robot]
        error, change = float("nan"), ""
        if fleet.trends and robot in fleet.trends.robots:
            seen = fleet.trends.error_percent[fleet.trends.robots.index(robot)]
            error = float(seen[np.isfinite(seen)][-1]) if np.isfinite(seen).any() else error
            change = "; ".join(
                f"joint {c.joint} {c.percent:+.0f} % ({c.level})"
                for c in fleet.trends.changes
                if c.robot == robot
            )
        findings = [text for job in jobs for text in fleet.findings.get(job, ())]
        rows.append(
            (
                Cell(robot),
                Cell(str(len(jobs)), len(jobs)),
                Cell("" if np.isnan(error) else f"{error:.1f} %", error),
                Cell(change, tone="bad" if "alarm" in change else ""),
                Cell(", ".join(findings)),
            )
        )
    return Section("The fleet", (Table("", columns, tuple(rows)),))


def _broken(fleet: Fleet) -> list[Section]:
    if not fleet.reasons:
        return []
    rows = [(Cell(j.robot), Cell(j.day), Cell(text)) for j, text in sorted(fleet.reasons.items(), key=_order)]
    columns = (Column("robot"), Column("day"), Column("reason"))
    return [Section("Recordings that could not be used", (Table("", columns, tuple(rows)),))]


def _order(item: tuple) -> tuple[str, str, str]:
    return item[0].order
