"""Joints by the names that their robot gives them, in every sentence and table that a person reads.

Files for programs keep numbers and parameter names (contract 5 and 6); `joints` in them says which is which.
Texts are made with numbers and get the names at the door, each once: `joint 2 (elbow)`, `tau_m2 (elbow)`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from ident.report.page import Cell, Plot, Remark, ReportPage, Section, Table
from modelgen.geometry.names import ParameterName

if TYPE_CHECKING:  # the module brings SymPy, which a fit does without
    from modelgen.geometry.robot import Robot

Names = Mapping[str, str]  # {"joint 2": "elbow", "link 3": "elbow"}
SIGNAL = r"(?<![\w.,{\[:/=-])(?P<signal>tau_[mld]|ddq|dq|q|i)(?P<number>\d+)(?![\w:\]}(=/]|\.\w)"
PLACE = r"\b(?P<what>[Jj]oint|[Ll]ink)(?P<many>s?) (?P<which>\d+(?:(?:, | and | to )\d+)*)(?![\w%]|\.\d)"
MENTION = re.compile(rf"(?:{SIGNAL}|{PLACE})(?P<more> \()?")
READ = frozenset(
    ("verdict", "text", "title", "caption", "x_label", "warnings", "details", "sections", "blocks", "rows")
)


def joints_of(model: Any) -> list[dict[str, Any]]:
    """[{"joint": "2", "row": 2, "name": "elbow"}] of the joints that a robot file or URDF names."""
    joints = model._description["joints"]
    return [
        {"joint": its["label"], "row": its.get("row", int(its["label"])), "name": its["name"]}
        for its in joints
        if "name" in its
    ]


def names_of(document: Mapping[str, Any]) -> Names:
    """What a document (fit.json, diagnosis.json, predict.json) says of its joints' names."""
    return names_in(document.get("joints", ()))


def joints_of_robot(robot: Robot) -> list[dict[str, Any]]:
    """The same of a robot that no model was made of."""
    rows = zip(robot.moving, robot.joint_labels, robot.joint_names)
    return [{"joint": k, "row": j, "name": name} for j, k, name in rows if name != f"q{k}"]


def names_in(joints: Iterable[Mapping[str, Any]]) -> Names:
    """{"joint 2": name, "link 3": name} of `joints_of`."""
    known = list(joints)
    out = {f"joint {its['joint']}": its["name"] for its in known}
    return out | {f"link {its['row']}": f"moved by {its['name']}" for its in known}


def named(text: str, names: Names) -> str:
    """A sentence with the joints' names behind their numbers, each once; keys stay as they are."""
    if not names:
        return text
    said: set[str] = set()

    def name(key: str) -> str:
        if key in said or key not in names:
            return ""
        said.add(key)
        return f" ({names[key]})"

    def mention(found: re.Match[str]) -> str:
        if found["signal"]:
            text = f"{found['signal']}{found['number']}" + name(f"joint {found['number']}")
        else:
            kind = found["what"].lower()
            numbers = re.sub(r"\d+", lambda n: n[0] + name(f"{kind} {n[0]}"), found["which"])
            text = f"{found['what']}{found['many']} {numbers}"
        if not found["more"]:
            return text
        return f"{text[:-1]}, " if text.endswith(")") else f"{text} ("  # one bracket of two

    return MENTION.sub(mention, text)


def joint_of(name: str, names: Names) -> str:
    """The joint of a channel, parameter or effect: "tau_m2", "Fvm2R", "spring:2.k" -> "elbow"; of a body
    "moved by elbow"."""
    numbered = re.match(r"(?:tau_[mld]|\w+:)(\d+)", name)
    its = None if numbered else ParameterName.of(name)
    if its is not None:
        return names.get(f"{'link' if its.of_body else 'joint'} {its.label}", "")
    return names.get(f"joint {numbered[1]}", "") if numbered else ""


def with_names(
    header: Sequence[str], rows: Sequence[Sequence[str]], names: Names
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """A table of channels or parameters with a last column `joint`, where any has a name."""
    told = [joint_of(row[0], names) for row in rows] if names else []
    if not any(told):
        return tuple(header), [tuple(row) for row in rows]
    return (*header, "joint"), [(*row, joint) for row, joint in zip(rows, told)]


def page_with_names(page: ReportPage, names: Names) -> ReportPage:
    """Every text of a page that is read."""
    return _read(page, names) if names else page


def _read(value: Any, names: Names) -> Any:
    """Texts of a page's values; a table's cells one by one, figures and curves as they are."""
    if isinstance(value, str):
        return named(value, names)
    if isinstance(value, tuple):
        return tuple(_read(item, names) for item in value)
    if not isinstance(value, ReportPage | Section | Remark | Table | Cell | Plot):
        return value
    texts = {its.name: getattr(value, its.name) for its in fields(value) if its.name in READ}
    return replace(value, **{name: _read(text, names) for name, text in texts.items()})
