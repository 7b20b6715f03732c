"""Where a motion may not go: boxes that named points stay out of, told by options or by a file.

    --point tool=7:0,0,0.12            a point of link 7 (a row, or a link's name), in its frame, m
    --keep-out table=-1..1,-1..1,-1..0 a box in base axes, m, for every named point
    --keep-out table=...:tool          for this point alone
    --keep-out cell.yaml               points: {tool: {link: 7, at: [0, 0, 0.12]}}
                                       keep_out: {table: {low: [-1, -1, -1], high: [1, 1, 0], points: [tool]}}

Without a point the origin of the last link is one, `end`. A link's name is one of the robot file, whose frame
is its row's, or one of the URDF, whose frame is the URDF's own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ident.excitation.limits import ExcitationError
from modelgen.effects.frames import Frames
from modelgen.errors import ModelgenError
from modelgen.geometry import strict_yaml
from modelgen.geometry.robot import Robot

Array = np.ndarray
SMOOTH = 0.005  # m over which the faces of a box are joined while designing
LARGEST_FILE = 1 << 20


@dataclass(frozen=True)
class Point:
    """A point fixed to row `row` (0-based; -1 is the base) at `at` (3,) m in its frame."""

    name: str
    row: int
    at: Array

    def place(self, f: Frames) -> Array:
        """(N, 3) in base axes."""
        return (
            self.at + np.zeros((len(f.p), 3))
            if self.row < 0
            else f.p[:, self.row] + f.R[:, self.row] @ self.at
        )


@dataclass(frozen=True)
class Box:
    """low, high (3,) m in base axes, and the names of the points that keep out of it."""

    name: str
    low: Array
    high: Array
    points: tuple[str, ...]

    def outside(self, p: Array) -> Array:
        """(N,) m that p (N, 3) is beyond the face it is farthest beyond; negative inside."""
        return np.max(np.concatenate((self.low - p, p - self.high), axis=1), axis=1)

    def smooth(self, p: Array) -> tuple[Array, Array]:
        """A smooth lower bound of `outside` and its slope (N, 3)."""
        faces = np.concatenate((self.low - p, p - self.high), axis=1) / SMOOTH
        most = faces.max(axis=1, keepdims=True)
        weight = np.exp(faces - most)
        total = weight.sum(axis=1, keepdims=True)
        share = weight / total
        value = SMOOTH * (most + np.log(total / 6))[:, 0]
        return value, share[:, 3:] - share[:, :3]


def moved(f: Frames, row: int, p: Array) -> Array:
    """(N, 3, n): how p (N, 3), fixed to a row, moves with every joint."""
    J = np.zeros((len(p), 3, f.n))
    for k in f.above(row) if row >= 0 else ():
        if f.joint[k] >= 0:
            z = f.R[:, k, :, 2]
            J[:, :, f.joint[k]] = z if f.sigma[k] == 1 else np.cross(z, p - f.p[:, k])
    return J


@dataclass(frozen=True)
class KeepOut:
    """Named points and the boxes they keep out of; one clearance for each pair of them."""

    points: tuple[Point, ...]
    boxes: tuple[Box, ...]

    @property
    def pairs(self) -> list[tuple[Point, Box]]:
        return [(point, box) for box in self.boxes for point in self.points if point.name in box.points]

    def told(self, k: int) -> str:
        point, box = self.pairs[k]
        return f"the keep-out box {box.name} for the point {point.name}"

    def exact(self, f: Frames) -> Array:
        """(N, pairs) m outside."""
        return np.stack([box.outside(point.place(f)) for point, box in self.pairs], axis=1)

    def smooth(self, f: Frames) -> tuple[Array, Array]:
        """(N, pairs) m that are never more than `exact`, and their slopes (N, pairs, n)."""
        values, slopes = [], []
        for point, box in self.pairs:
            p = point.place(f)
            value, slope = box.smooth(p)
            values.append(value)
            slopes.append(np.einsum("ni,nik->nk", slope, moved(f, point.row, p)))
        return np.stack(values, axis=1), np.stack(slopes, axis=1)


def keep_out(
    robot: Robot, points: Sequence[str], boxes: Sequence[str], links: Mapping[str, tuple[int, Array, Array]]
) -> KeepOut | None:
    """From options. `links`: a URDF's links as (row, R (3, 3), p (3,)) in the row's frame. None: no box.

    Raises ExcitationError naming what cannot be read."""
    made = [_point(text, robot, links) for text in points]
    raw: list[Box] = []
    for text in boxes:
        if "=" in text or not text.strip():
            raw.append(_box(text))
        else:
            its_points, its_boxes = _from_file(Path(text), robot, links)
            made, raw = [*made, *its_points], [*raw, *its_boxes]
    if not raw:
        if made:
            raise ExcitationError(f"--point {made[0].name}: there is no box to keep out of; give --keep-out.")
        if boxes:
            raise ExcitationError(f"--keep-out {boxes[0]}: holds no box; give one under keep_out.")
        return None
    made = made or [Point("end", len(robot.links) - 1, np.zeros(3))]
    names = [point.name for point in made]
    for kind, listed in (("point", names), ("keep-out", [box.name for box in raw])):
        for name in listed:
            if listed.count(name) > 1:
                raise ExcitationError(f"--{kind} {name} is there twice; give each its own name.")
    out = []
    for box in raw:
        for name in box.points:
            if name not in names:
                raise ExcitationError(
                    f"--keep-out {box.name}: there is no point {name}; points are {', '.join(names)}."
                )
        out.append(Box(box.name, box.low, box.high, box.points or tuple(names)))
    return KeepOut(tuple(made), tuple(out))


def _point(text: str, robot: Robot, links: Mapping[str, tuple[int, Array, Array]]) -> Point:
    name, equals, rest = text.partition("=")
    link, _, at = rest.partition(":")
    if not equals or not name.strip() or not link.strip():
        raise ExcitationError(f"--point {text}: write NAME=LINK:x,y,z, for example tool=7:0,0,0.12.")
    return _placed(
        f"--point {text}", name.strip(), link.strip(), at.split(",") if at else [0, 0, 0], robot, links
    )


def _placed(where: str, name: str, link: Any, at: Any, robot: Robot, links: Mapping[str, Any]) -> Point:
    rows = {row.name: k for k, row in enumerate(robot.links)}
    rows |= {str(k): k - 1 for k in range(len(robot.links) + 1)}
    p = np.array(_numbers(where, at, 3))
    if str(link) in links:
        row, R, origin = links[str(link)]
        return Point(name, row, origin + R @ p)
    if str(link) not in rows:
        known = ", ".join(links) if links else f"0 (the base) to {len(robot.links)}"
        raise ExcitationError(f"{where}: there is no link {link}; links are {known}.")
    return Point(name, rows[str(link)], p)


def _box(text: str) -> Box:
    name, _, rest = text.partition("=")
    sides, _, points = rest.partition(":")
    ends = [side.split("..") for side in sides.split(",")]
    if not name.strip() or len(ends) != 3 or any(len(pair) != 2 for pair in ends):
        raise ExcitationError(
            f"--keep-out {text}: write NAME=x..x,y..y,z..z[:POINT], for example table=-1..1,-1..1,-1..0, "
            "or the path of a file."
        )
    low, high = ([pair[k] for pair in ends] for k in (0, 1))
    return _checked(f"--keep-out {text}", name.strip(), low, high, [p for p in points.split(",") if p])


def _checked(where: str, name: str, low: Any, high: Any, points: Sequence[str]) -> Box:
    a, b = (np.array(_numbers(where, side, 3, bounded=False)) for side in (low, high))
    if not np.all(a < b):
        remedy = "swap them" if np.any(a > b) else "a box is as wide as what is in the way"
        raise ExcitationError(f"{where}: a lower side is not below its upper one; {remedy}.")
    if np.isinf([a, b]).all():
        raise ExcitationError(f"{where}: leaves no room outside of it; give one side that ends.")
    return Box(name, a, b, tuple(str(p).strip() for p in points))


def _numbers(where: str, values: Any, count: int, bounded: bool = True) -> list[float]:
    try:
        out = [] if isinstance(values, str) else [float(v) for v in values if not isinstance(v, bool)]
    except (TypeError, ValueError):
        out = []
    if len(out) != count or any(math.isnan(x) or (bounded and math.isinf(x)) for x in out):
        raise ExcitationError(f"{where}: give {count} numbers, in m.")
    return out


def _from_file(
    file: Path, robot: Robot, links: Mapping[str, tuple[int, Array, Array]]
) -> tuple[list[Point], list[Box]]:
    try:
        data = strict_yaml.load(strict_yaml.read(file, LARGEST_FILE))
    except (OSError, ModelgenError):
        raise ExcitationError(
            f"--keep-out {file}: is no file that can be read; give YAML with points and keep_out, or a box "
            "as table=-1..1,-1..1,-1..0."
        ) from None
    tables = {key: data.get(key) or {} for key in ("points", "keep_out")} if isinstance(data, dict) else {}
    if not tables or set(data) - set(tables) or not all(isinstance(t, dict) for t in tables.values()):
        raise ExcitationError(f"{file}: give two tables, points and keep_out, and nothing else.")
    points, boxes = [], []
    for name, row in tables["points"].items():
        if not isinstance(row, dict) or set(row) - {"link", "at"} or "link" not in row:
            raise ExcitationError(f"{file}: point {name}: write {{link: 7, at: [0, 0, 0.12]}}.")
        where = f"{file}: point {name}"
        points.append(_placed(where, str(name), row["link"], row.get("at", [0, 0, 0]), robot, links))
    for name, row in tables["keep_out"].items():
        where, known = f"{file}: box {name}", {"low", "high", "points"}
        if not isinstance(row, dict) or set(row) - known or not {"low", "high"} <= set(row):
            raise ExcitationError(f"{where}: write {{low: [x, y, z], high: [x, y, z]}}.")
        its = row.get("points") or []
        if not isinstance(its, list):
            raise ExcitationError(f"{where}: points are a list, as points: [{its}].")
        boxes.append(_checked(where, str(name), row["low"], row["high"], its))
    return points, boxes
