"""A URDF as a robot: its MDH table, its joints' names, the inertial parameters it gives, what was rounded.

`convert` gives all of it; its `robot` stands wherever a robot file's robot stands. q, dq and torque are the
URDF's own, joint by joint in the file's order, depth first; gravity is [0, 0, -9.81] in the root link.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass

import sympy as sp

from modelgen.errors import ModelgenError, RobotFileError
from modelgen.geometry.robot import ZERO, Robot
from modelgen.geometry.urdf_file import Urdf, read_urdf
from modelgen.geometry.urdf_mdh import Body, Table, inertial_parameters, table
from modelgen.geometry.urdf_xml import LARGEST_TEXT

GRAVITY = (ZERO, ZERO, sp.Rational(-981, 100))
__all__ = ["LARGEST_TEXT", "Conversion", "convert", "is_urdf"]


@dataclass(frozen=True, slots=True)
class Conversion:
    """`bodies` tell where each MDH frame stands in the URDF's link, and which links are fixed together."""

    robot: Robot
    urdf: Urdf
    bodies: tuple[Body, ...]


def is_urdf(data: bytes, source: str = "") -> bool:
    """True for a file called .urdf or .xacro, and for any XML: no YAML robot file begins with "<"."""
    start = data[:64].lstrip(b"\xef\xbb\xbf \t\r\n")
    return source.lower().endswith((".urdf", ".xacro")) or start.startswith(b"<")


def convert(data: bytes, source: str = "robot.urdf", exact: bool = False) -> Conversion:
    """Read a URDF; `exact` keeps its angles and lengths unrounded. Raises RobotFileError naming `source`."""
    try:
        if source.lower().endswith(".xacro"):
            stem = source[: -len(".xacro")]
            target = stem if stem.lower().endswith(".urdf") else f"{stem}.urdf"
            raise ModelgenError(f"is a xacro, which must be expanded first; run: xacro {source} > {target}")
        urdf = read_urdf(data)
        found = table(urdf, exact)
    except ModelgenError as error:
        raise RobotFileError(source, str(error)) from None
    robot = Robot(
        name=_identifier(urdf.name or re.sub(r"\.[^.]*$", "", source)),
        gravity=GRAVITY,
        links=found.rows,
        source_sha256=hashlib.sha256(data.replace(b"\r\n", b"\n")).hexdigest(),
        standard_values=_standard_values(urdf, found),
        notes=_notes(found),
    )
    return Conversion(robot, urdf, found.bodies)


def _identifier(name: str) -> str:
    """A name that a robot file, a folder and C may bear."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip("._-")[:80] or "robot"


def _standard_values(urdf: Urdf, found: Table) -> dict[str, float]:
    """Inertial parameters of every row, links that are fixed together as one; {} where the URDF has none."""
    if not any(urdf.links[name] for body in found.bodies for name, _ in body.links):
        return {}
    values = {}
    for body in found.bodies:
        for kind, value in inertial_parameters(body, dict(urdf.links)).items():
            values[f"{kind}{body.row}"] = value
    return values


def _notes(found: Table) -> tuple[str, ...]:
    notes = []
    if found.turned:
        notes.append(
            f"angles at {_some(found.turned)} were taken as the multiple of pi/2 beside them (at most "
            f"{max(found.turned.values()):.1g} rad away); --exact, or exact: true in a study, keeps them"
        )
    if found.shortened:
        notes.append(
            f"lengths below 1e-9 m at {_some(found.shortened)} were taken as zero; --exact, or "
            "exact: true in a study, keeps them"
        )
    across = [link.name for link in found.rows if link.joint == "fixed"]
    if across:
        notes.append(
            f"some axes are almost parallel to the one before: fixed rows stand between ({len(across)})"
        )
    return tuple(notes)


def _some(names: dict[str, float]) -> str:
    listed = list(names)
    return ", ".join(listed[:3]) + (f" and {len(listed) - 3} more joints" if len(listed) > 3 else "")
