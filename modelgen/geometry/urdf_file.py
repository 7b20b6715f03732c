"""What a URDF says, as checked values: links with inertia, joints with place, axis and limits, one tree.

Only what mechanics needs is read: `link/inertial` and `joint`; visuals, collisions, transmissions and
simulators' own elements are passed over. Numbers are kept as they are written (exact decimals). What the
models here cannot mean is refused with the joint's name: mimic, floating and planar joints, closed loops.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from modelgen.errors import ModelgenError
from modelgen.geometry import plausible
from modelgen.geometry.robot import SIGMA, Limits
from modelgen.geometry.urdf_xml import Element, read

T = TypeVar("T")
Triple = tuple[Fraction, Fraction, Fraction]
NONE: Triple = (Fraction(0), Fraction(0), Fraction(0))
MOVING = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
LARGEST = 10**6  # m, rad, kg, kg m^2: anything larger is a mistake
LONGEST_NAME = 80
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?\Z", re.ASCII)


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass (kg), place of the centre of mass in the link (m, rad), inertia there: xx, xy, xz, yy, yz, zz."""

    mass: Fraction
    xyz: Triple
    rpy: Triple
    inertia: tuple[Fraction, ...]


@dataclass(frozen=True, slots=True)
class Joint:
    """`kind`: revolute | prismatic | fixed; the child link's frame stands at xyz, rpy in the parent's."""

    name: str
    kind: str
    parent: str
    child: str
    xyz: Triple
    rpy: Triple
    axis: Triple
    limits: Limits | None


@dataclass(frozen=True, slots=True)
class Urdf:
    """A tree: `children` gives the joints that leave a link, in the file's order."""

    name: str
    root: str
    links: Mapping[str, Inertial | None]
    children: Mapping[str, tuple[Joint, ...]]


def read_urdf(data: bytes) -> Urdf:
    """Read and check a URDF. Raises ModelgenError, one sentence without the file's name."""
    top = read(data)
    _refuse_other_formats(top)
    links = _named(top, "link", _inertial)
    joints = _named(top, "joint", _joint)
    if not links:
        raise ModelgenError("has no link; a URDF lists <link> and <joint> elements inside <robot>")
    for joint in joints.values():
        for role, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in links:
                raise ModelgenError(
                    f"joint {joint.name} has the {role} {name}, which is no link of the file; correct it"
                )
    root = _root(links, joints)
    if not any(joint.kind != "fixed" for joint in joints.values()):
        raise ModelgenError("has no moving joint; a model needs a revolute, continuous or prismatic one")
    children = {
        name: tuple(joint for joint in joints.values() if joint.parent == name)
        for name in dict.fromkeys(joint.parent for joint in joints.values())
    }
    return Urdf(top.attributes.get("name", ""), root, links, children)


def _refuse_other_formats(top: Element) -> None:
    if top.tag != "robot":
        kinds = {"sdf": "an SDF", "mujoco": "an MJCF", "mujocoinclude": "an MJCF", "COLLADA": "a mesh"}
        kind = kinds.get(top.tag, f"an XML file of <{top.tag[:40]}>")
        raise ModelgenError(f"is {kind} and no URDF; give a file whose first element is <robot>")
    waiting = [top]
    while waiting:
        element = waiting.pop()
        unexpanded = element.tag.startswith("xacro:") or any(
            "${" in value or "$(" in value for value in element.attributes.values()
        )
        if unexpanded and element.tag not in ("gazebo", "plugin", "mesh"):
            raise ModelgenError(
                f"is a xacro that is not expanded (line {element.line}); run: xacro arm.urdf.xacro > arm.urdf"
            )
        if element.tag in ("robot", "link", "joint", "inertial") or element.tag.startswith("xacro:"):
            waiting += element.children


def _named(top: Element, tag: str, read_one: Callable[[Element, str], T]) -> dict[str, T]:
    found: dict[str, T] = {}
    for element in top.all(tag):
        name = element.attributes.get("name", "").strip()
        if not name or len(name) > LONGEST_NAME or not name.isprintable():
            raise ModelgenError(
                f"the {tag} in line {element.line} has the name {name[:40]!r}; give it a name of at most "
                f"{LONGEST_NAME} characters"
            )
        if name in found:
            raise ModelgenError(f"has two {tag}s named {name} (line {element.line}); rename or remove one")
        found[name] = read_one(element, name)
    return found


def _inertial(link: Element, name: str) -> Inertial | None:
    element = link.first("inertial")
    if element is None:
        return None
    where = f"link {name}, inertial"
    xyz, rpy = _origin(element, where)
    mass, inertia = element.first("mass"), element.first("inertia")
    kg = Fraction(0) if mass is None else _number(mass.attributes.get("value"), f"{where}, mass")
    if kg < 0:
        raise ModelgenError(f"{where} has the mass {float(kg):g} kg; correct it or remove the inertial")
    given = {} if inertia is None else inertia.attributes
    values = tuple(
        _number(given.get(key, "0"), f"{where}, {key}") for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    return Inertial(kg, xyz, rpy, values)


def _joint(element: Element, name: str) -> Joint:
    where = f"joint {name}"
    kind = element.attributes.get("type", "")
    if element.first("mimic") is not None:
        raise ModelgenError(
            f"{where} mimics another joint, which a tree of free joints cannot say; make it type fixed, or "
            "remove <mimic> if it has a motor of its own"
        )
    if kind not in (*MOVING, "fixed"):
        known = "revolute, continuous, prismatic or fixed"
        remedy = "describe one limb on a fixed base" if kind in ("floating", "planar") else "correct the type"
        raise ModelgenError(f"{where} is of type {kind or 'none'!s}; only {known} is read: {remedy}")
    ends = []
    for role in ("parent", "child"):
        end = element.first(role)
        if end is None or not end.attributes.get("link"):
            raise ModelgenError(f'{where} has no {role} link; write <{role} link="..."/>')
        ends.append(end.attributes["link"].strip())
    xyz, rpy = _origin(element, where)
    axis = element.first("axis")
    direction = (Fraction(1), Fraction(0), Fraction(0))
    if axis is not None:
        direction = _triple(axis.attributes.get("xyz", "1 0 0"), f"{where}, axis")
    if kind != "fixed" and direction == NONE:
        raise ModelgenError(f"{where} has the axis 0 0 0; give its direction")
    limits = None if kind == "fixed" else _limits(element, kind, where)
    return Joint(name, MOVING.get(kind, kind), ends[0], ends[1], xyz, rpy, direction, limits)


def _limits(joint: Element, kind: str, where: str) -> Limits | None:
    """Position, speed and effort. For "not known" exporters write 0, an empty range, 1000 rad/s, 1e16."""
    element = joint.first("limit")
    if element is None:
        return None
    given = {key: _limit(element, key, where) for key in ("lower", "upper", "velocity", "effort")}
    lower, upper = given["lower"], given["upper"]
    if lower > upper:
        raise ModelgenError(f"{where} has limits from {lower:g} to {upper:g}; lower must be below upper")
    sigma = SIGMA[MOVING[kind]]
    bounded = kind != "continuous" and lower < upper and not plausible.limits(sigma, (lower, upper), None)
    moves = given["velocity"] > 0 and not plausible.limits(sigma, None, given["velocity"])
    limits = Limits(
        q=(lower, upper) if bounded else None,
        dq=given["velocity"] if moves else None,
        tau=given["effort"] if 0 < given["effort"] < LARGEST else None,
    )
    return None if limits == Limits() else limits


def _limit(element: Element, key: str, where: str) -> float:
    try:
        value = float(element.attributes.get(key, "0"))
    except ValueError:
        value = math.nan
    if math.isnan(value):
        text = element.attributes[key][:40]
        raise ModelgenError(f"{where}, limit {key} is {text!r} and no number; write for example 3.14")
    return value


def _origin(element: Element, where: str) -> tuple[Triple, Triple]:
    origin = element.first("origin")
    if origin is None:
        return NONE, NONE
    if "quat_xyzw" in origin.attributes:
        raise ModelgenError(f"{where} has an origin with quat_xyzw; write the rotation as rpy")
    xyz, rpy = (_triple(origin.attributes.get(key, "0 0 0"), f"{where}, {key}") for key in ("xyz", "rpy"))
    problems = [("xyz", plausible.length(float(x))) for x in xyz]
    problems += [("rpy", plausible.angle(float(x))) for x in rpy]
    for key, problem in problems:
        if problem:
            raise ModelgenError(f"{where}, {key} {problem}")
    return xyz, rpy


def _triple(text: str, where: str) -> Triple:
    words = text.split()
    if len(words) != 3:
        raise ModelgenError(f"{where} is {text[:40]!r}; write three numbers with spaces between them")
    x, y, z = (_number(word, where) for word in words)
    return x, y, z


def _number(text: str | None, where: str) -> Fraction:
    """The decimal as it is written; urdfdom reads the same grammar."""
    text = (text or "").strip()
    if len(text) > 60 or not NUMBER.match(text):
        raise ModelgenError(f"{where} is {text[:40]!r} and no number; write for example 0.39")
    if abs(float(text)) > LARGEST:
        raise ModelgenError(f"{where} is {text[:40]}; check its unit (m, rad, kg)")
    return Fraction(text)


def _root(links: Mapping[str, object], joints: Mapping[str, Joint]) -> str:
    carried: dict[str, str] = {}
    for joint in joints.values():
        if joint.child in carried:
            raise ModelgenError(
                f"link {joint.child} is the child of the joints {carried[joint.child]} and {joint.name}, "
                "which closes a loop; remove one of them"
            )
        carried[joint.child] = joint.name
    roots = [name for name in links if name not in carried]
    if len(roots) > 1:
        raise ModelgenError(
            f"has {len(roots)} root links ({', '.join(roots[:4])}{' ...' if len(roots) > 4 else ''}); join "
            "them with fixed joints or remove what does not belong to the robot"
        )
    if not roots:
        raise ModelgenError(
            f"its joints run in a circle ({', '.join(list(joints)[:4])}); one link must be no joint's child"
        )
    # one root and one parent for every other link: what the root does not reach is a circle of its own
    reached, waiting = {roots[0]}, [roots[0]]
    while waiting:
        link = waiting.pop()
        new = [joint.child for joint in joints.values() if joint.parent == link]
        reached.update(new)
        waiting += new
    apart = [joint.name for joint in joints.values() if joint.child not in reached]
    if apart:
        raise ModelgenError(f"the joints {', '.join(apart[:4])} run in a circle; lead each link to the root")
    return roots[0]
