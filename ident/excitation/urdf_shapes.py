"""What a URDF says of its links' shapes, and where its links are on the rows of the MDH table."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ident.excitation.limits import ExcitationError
from modelgen.errors import ModelgenError
from modelgen.geometry import strict_yaml, urdf
from modelgen.geometry.urdf_xml import Element, read

Array = np.ndarray
Places = Mapping[str, tuple[int, Array, Array]]  # link: its row (0-based, -1: the base), R (3, 3), p (3,)


@dataclass(frozen=True)
class Shape:
    """One <collision> of a link: `kind` mesh | box | sphere | cylinder | capsule, its numbers (m) or file,
    and its place R (3, 3), p (3,) in the frame of row `row`."""

    link: str
    row: int
    kind: str
    numbers: tuple[float, ...]
    file: Path | None
    R: Array
    p: Array


def link_places(source: str, exact: bool = False) -> Places:
    """Where a URDF's links are; {} for a robot that is no URDF."""
    found = _opened(source)
    return _places(urdf.convert(found[0], found[1].name, exact)) if found else {}


def shapes(source: str, exact: bool = False) -> list[Shape]:
    """Every <collision> of a URDF. Raises ExcitationError: no URDF, none given, a mesh that is not there."""
    found = _opened(source)
    if found is None:
        raise ExcitationError(f"--self-collision: {source} is no URDF and has no shapes; give the URDF.")
    data, file = found
    places = _places(urdf.convert(data, file.name, exact))
    out = [shape for link in read(data).all("link") for shape in _of_link(link, places, file)]
    if len({shape.row for shape in out}) < 2:
        raise ExcitationError(
            f"--self-collision: {file.name} has <collision> for {len({s.row for s in out})} of its bodies; "
            "give a URDF with collision shapes."
        )
    return out


def _opened(source: str) -> tuple[bytes, Path] | None:
    path = Path(source)
    if not path.is_file():
        path = Path(str(files("modelgen").joinpath("robots", f"{source}.urdf")))
    if not path.is_file():
        return None
    try:
        data = strict_yaml.read(path, urdf.LARGEST_TEXT)
    except (OSError, ModelgenError):
        return None
    return (data, path) if urdf.is_urdf(data, path.name) else None


def _places(found: urdf.Conversion) -> Places:
    out: dict[str, tuple[int, Array, Array]] = {}
    for body in found.bodies:
        back = body.frame.inverse()
        for name, frame in body.links:
            here = back @ frame
            out[name] = (body.row - 1, np.array(here.R, dtype=float), np.array(here.p, dtype=float))
    waiting = [(found.urdf.root, np.eye(3), np.zeros(3))]
    while waiting:
        name, R, p = waiting.pop()
        out[name] = (-1, R, p)
        for joint in found.urdf.children.get(name, ()):
            if joint.kind == "fixed":
                at = np.array([float(x) for x in joint.xyz])
                waiting.append((joint.child, R @ _turn([float(x) for x in joint.rpy]), p + R @ at))
    return out


def _turn(rpy: Sequence[float]) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    return Rotation.from_euler("xyz", rpy).as_matrix()


def _of_link(link: Element, places: Places, file: Path) -> Iterator[Shape]:
    name = link.attributes.get("name", "").strip()
    row, R, p = places[name]
    for collision in link.all("collision"):
        geometry = collision.first("geometry")
        if geometry is None or not geometry.children:
            continue
        origin, its = collision.first("origin"), geometry.children[0]
        given = origin.attributes if origin is not None else {}
        xyz, rpy = (_numbers(given.get(key, "0 0 0"), name, file, 3) for key in ("xyz", "rpy"))
        mesh = None
        if its.tag == "mesh":
            mesh = _mesh(its.attributes.get("filename", ""), name, file)
            numbers = _numbers(its.attributes.get("scale", "1 1 1"), name, file, 3)
        elif its.tag in ("sphere", "box", "cylinder", "capsule"):
            keys = {"sphere": ("radius",), "box": ("size",)}.get(its.tag, ("radius", "length"))
            text = " ".join(its.attributes.get(key, "") for key in keys)
            numbers = _numbers(text, name, file, 3 if its.tag == "box" else len(keys))
        else:
            raise ExcitationError(f"{file.name}: link {name} has the shape {its.tag}, which is not known.")
        yield Shape(name, row, its.tag, numbers, mesh, R @ _turn(rpy), p + R @ np.array(xyz))


def _numbers(text: str, link: str, file: Path, count: int) -> tuple[float, ...]:
    try:
        out = tuple(float(word) for word in text.split())
    except ValueError:
        out = ()
    if len(out) != count or not all(map(math.isfinite, out)):
        raise ExcitationError(f"{file.name}: link {link}, collision: {text[:40]!r} is not {count} numbers.")
    return out


def _mesh(name: str, link: str, file: Path) -> Path:
    """A mesh beside the URDF, or in a package above it or on ROS_PACKAGE_PATH."""
    text = name.removeprefix("file://")
    if text.startswith("package://"):
        package, _, rest = text.removeprefix("package://").partition("/")
        above = file.resolve().parents
        roots = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
        tried = [folder / package / rest for folder in (*above, *roots)]
        tried += [folder / rest for folder in (*above, *roots) if folder.name == package]
    else:
        tried = [file.resolve().parent / text]
    found = next((path for path in tried if path.is_file()), None)
    if found is None:
        raise ExcitationError(
            f"--self-collision: the mesh {name} of link {link} is not there; put it beside {file.name}, or "
            "its package on ROS_PACKAGE_PATH."
        )
    return found
