"""A robot as the text of an MDH robot file, with comments that name each joint and what it carries.

Reading the text gives the same table; of numbers with more than 17 digits the nearest double is written. What
a robot file cannot say of a URDF, its inertial parameters and its links' names, stands in comments.
"""

from __future__ import annotations

import json
from pathlib import Path

import sympy as sp

from modelgen.geometry.robot import Limits, Link, Robot
from modelgen.geometry.robot_file import load_robot
from modelgen.geometry.urdf import Conversion, convert, is_urdf

SMALLEST = 1e-12  # what a robot file can hold


def robot_text(name_or_path: str | Path, exact: bool = False) -> tuple[str, tuple[str, ...]]:
    """The YAML of a URDF, of a robot file or of a built-in robot, and remarks on it for the user.

    `exact`: a URDF's angles and lengths as they are written. Raises RobotFileError.
    """
    robot = load_robot(name_or_path)
    path = Path(name_or_path)
    data = path.read_bytes() if path.is_file() else b""
    if not is_urdf(data, path.name if data else ""):
        return as_text(robot), robot.remarks
    conversion = convert(data, path.name, exact)
    return as_text(conversion.robot, conversion), conversion.robot.remarks


def as_text(robot: Robot, conversion: Conversion | None = None) -> str:
    """A robot file's text; `conversion` adds comments on the URDF that it came from."""
    lines = [f"# {line}" for line in _opening(robot, conversion)]
    lines += [f"name: {json.dumps(robot.name)}", "convention: mdh"]
    lines += [f"gravity: [{', '.join(_value(g) for g in robot.gravity)}]"]
    if robot.constants:
        given = ", ".join(f"{name}: {_value(value)}" for name, value in robot.constants.items())
        lines += [f"constants: {{{given}}}"]
    if robot.payloads:
        lines += [f"payloads: {{{', '.join(f'{label}: {row}' for label, row in robot.payloads.items())}}}"]
    lines += ["links:"]
    carried = {body.row: [name for name, _ in body.links] for body in conversion.bodies} if conversion else {}
    for j, link in enumerate(robot.links, 1):
        lines += _comments(robot, j, link, carried.get(j, []))
        lines += [f"  - {{{', '.join(_row(j, link))}}}"]
    return "\n".join(lines) + "\n"


def _opening(robot: Robot, conversion: Conversion | None) -> list[str]:
    if conversion is None:
        return [f"{robot.name}."]
    return [
        f"{robot.name}, from a URDF: the base is {conversion.urdf.root}; q1 ... q{robot.n} are its joints,",
        "with their own zero and sign (a constant behind a variable is where the table's zero is).",
        *robot.notes,
    ]


def _comments(robot: Robot, j: int, link: Link, carried: list[str]) -> list[str]:
    if link.name == f"link{j}" and not carried:
        return []
    first = f"  # {link.variable or 'fixed'}: {link.name}"
    lines = [first + (f", moves {', '.join(carried)}" if carried else "")]
    values = {name: value for name, value in robot.standard_values.items() if name.endswith(f"{j}")}
    known = [(k, v) for k, v in values.items() if k.rstrip("0123456789") + str(j) == k and v]
    if known:
        lines += [f"  #   {', '.join(f'{name} {value:.6g}' for name, value in known)}"]
    return lines


def _row(j: int, link: Link) -> list[str]:
    cells = [f"joint: {link.joint}", f"antecedent: {link.antecedent}"]
    if link.name != f"link{j}":
        cells = [f"name: {json.dumps(link.name)}", *cells]
    for key in ("gamma", "b", "alpha", "d", "theta", "r"):
        value = _value(getattr(link, key))
        if link.variable and key == ("theta" if link.joint == "revolute" else "r"):
            sign, size = ("-", value[1:]) if value.startswith("-") else ("+", value)
            value = link.variable if value == "0" else f"{link.variable} {sign} {size}"
        if value != "0" or key not in ("gamma", "b"):
            cells.append(f"{key}: {value}")
    if link.limits:
        cells.append(f"limits: {{{_limits(link.limits)}}}")
    return cells


def _limits(limits: Limits) -> str:
    cells = [f"q: [{limits.q[0]!r}, {limits.q[1]!r}]"] if limits.q else []
    cells += [f"{key}: {value!r}" for key in ("dq", "ddq", "tau") if (value := getattr(limits, key))]
    return ", ".join(cells)


def _value(x: sp.Expr) -> str:
    """Text that a robot file's parser reads back: a part of pi, a decimal, an expression of lengths."""
    if not x.is_Rational:
        return str(sp.sstr(x))
    number = float(x)
    if abs(number) < SMALLEST:
        return "0"
    return str(int(x)) if x.is_Integer else repr(number)
