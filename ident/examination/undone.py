"""The study with the gross faults undone that checks found."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import yaml

from ident.errors import IdentError
from ident.examination.check import Check
from ident.recordings.study import Study


def undoing(check: Check) -> dict[str, Any] | None:
    """The line of a study that undoes what a check found; None where it has none, or more than one."""
    if check.outcome != "warned" or not check.remedy:
        return None
    try:
        line = yaml.safe_load(check.remedy)
    except yaml.YAMLError:
        return None
    return line if isinstance(line, dict) and set(line) <= {"columns", "gravity", "recordings"} else None


def unsettled(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Faults of the recordings or of the robot file that nothing undoes: all else is told with them in it."""
    grave = (c for c in checks if c.outcome == "warned" and (c.robot_file or c.open or c.explains))
    return tuple(c for c in grave if undoing(c) is None)


def mended_study(study: Study, checks: Iterable[Check]) -> Study | None:
    """The study with the remedies of its gross faults written in; None where there is nothing to undo.

    A remedy is the study's own line (`columns: {tau_m3: {sign: -1}}`, `gravity: [9.81, 0, 0]`, or one
    recording's, `recordings: [{name: run1, columns: ...}]`), so what is applied here is what a person would
    paste. Maps that a recording has of its own change alike.
    """
    changes: dict[str, Any] = {}
    columns, own = dict(study.columns), [dict(entry.columns) for entry in study.recordings]
    for check in checks:
        line = undoing(check)
        if line is None:
            continue
        changes |= {key: tuple(value) for key, value in line.items() if key == "gravity"}
        for name, value in line.get("columns", {}).items():
            before = columns.get(name)
            columns[name] = _column(name, value)
            for maps in own:
                if name in maps and before is not None:
                    maps[name] = _of_its_own(maps[name], before, columns[name])
        changes["columns"] = columns
        for its in line.get("recordings", ()):
            maps = own[[entry.label for entry in study.recordings].index(its["name"])]
            for name, value in its["columns"].items():
                before, after = columns.get(name, _column(name, {})), _column(name, value)
                maps[name] = _of_its_own(maps[name], before, after) if name in maps else after
    if not changes:
        return None
    if any(own):
        changes["recordings"] = tuple(
            entry.model_copy(update={"columns": maps}) for entry, maps in zip(study.recordings, own)
        )
    try:
        return study.with_(**changes)
    except (IdentError, ValueError):
        return None


def _of_its_own(own: Any, before: Any, after: Any) -> Any:
    """A recording's own map, changed as the study's is from one to another."""
    sign, scale = own.sign * before.sign * after.sign, own.scale * after.scale / before.scale
    return own.model_copy(update={"sign": sign, "scale": scale})


def _column(name: str, value: Any) -> Any:
    from ident.recordings.study import ColumnMap

    plain = value if isinstance(value, dict) else {"column": value}
    return ColumnMap(**({"column": name} | plain))
