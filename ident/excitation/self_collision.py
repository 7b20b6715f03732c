"""Whether a robot touches itself: exactly by coal on the convex hulls of its shapes, smoothly by capsules.

Pairs are those of bodies that no joint joins, without those that touch in every posture (they are said). The
hull of a shape holds the shape, the capsule holds the hull. While designing, the distance of the capsules'
axes less their radii is kept above MARGIN; the final motion is looked at with coal so that no sample is left
out: two hulls at a distance d cannot touch before their points have moved d towards each other, and until
then samples need no look.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ident.excitation.limits import Bounds, ExcitationError
from ident.excitation.obstacles import moved
from ident.excitation.urdf_shapes import Shape, shapes
from modelgen.effects.frames import Frames, frames
from modelgen.geometry.robot import Robot

Array = np.ndarray
MARGIN = 0.005  # m between capsules while designing
POSTURES = 100  # random ones that are looked at
ALWAYS = 0.98  # share of them from which on touching is how the robot is built
OFTEN = 0.5  # share of free postures in which capsules must be apart to be of use


@dataclass(frozen=True)
class Hull:
    """A convex hull on row `row` (-1: the base): coal's object and its place; the capsule around it, a to b
    (3,) with radius r, in the row's frame; all of it is within `reach` m of `centre`."""

    link: str
    row: int
    object: Any
    R: Array
    p: Array
    a: Array
    b: Array
    r: float

    @property
    def centre(self) -> Array:
        return (self.a + self.b) / 2

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.b - self.a)) / 2 + self.r


@dataclass(frozen=True)
class SelfCollision:
    """pairs: numbers of hulls that must not touch; smooth: those that capsules speak for."""

    robot: Robot
    hulls: tuple[Hull, ...]
    pairs: tuple[tuple[int, int], ...]
    smooth_pairs: tuple[tuple[int, int], ...] = ()
    left_out: tuple[str, ...] = ()

    def smooth(self, f: Frames) -> tuple[Array, Array]:
        """(N, smooth pairs) m between capsules less MARGIN, and their slopes (N, pairs, n)."""
        values, slopes = [], []
        for i, j in self.smooth_pairs:
            A, B = self.hulls[i], self.hulls[j]
            p, q = nearest(
                *(_placed(f, A.row, x) for x in (A.a, A.b)), *(_placed(f, B.row, x) for x in (B.a, B.b))
            )
            way = p - q
            d = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
            J = moved(f, A.row, p) - moved(f, B.row, q)
            values.append(d - A.r - B.r - MARGIN)
            slopes.append(np.einsum("ni,nik->nk", way / d[:, None], J))
        return np.stack(values, axis=1), np.stack(slopes, axis=1)

    def touching(self, q: Array) -> tuple[int, str] | None:
        """The first sample of a densely sampled motion q (N, n) at which two hulls touch, and which; or None.

        Between samples postures are taken to move no farther than from one to the next."""
        f = frames(self.robot, q)
        steps = np.vstack([np.zeros((1, q.shape[1])), np.abs(np.diff(q, axis=0))])
        first: tuple[int, str] | None = None
        for i, j in self.pairs:
            A, B = self.hulls[i], self.hulls[j]
            travel = np.cumsum(self._approach(f, A, B, steps))
            k, end = 0, len(q) if first is None else first[0]
            while k < end:
                d = _distance(A, B, f, k)
                if d <= 0:
                    first = (k, f"{A.link} and {B.link}")
                    break
                k = max(k + 1, int(np.searchsorted(travel, travel[k] + d)))
        return first

    def _approach(self, f: Frames, A: Hull, B: Hull, steps: Array) -> Array:
        """(N,) m that points of A and B can have come closer in each step."""
        own, others = (
            set(f.above(A.row)) if A.row >= 0 else set(),
            set(f.above(B.row)) if B.row >= 0 else set(),
        )
        total = np.zeros(len(steps))
        for row in own ^ others:
            if f.joint[row] < 0:
                continue
            hull = A if row in own else B
            centre = _placed(f, hull.row, hull.centre)
            arm = np.linalg.norm(centre - f.p[:, row], axis=1).max() + hull.reach
            total += steps[:, f.joint[row]] * (1.0 if f.sigma[row] == 1 else arm)
        return total


def self_collision(
    robot: Robot, source: str, bounds: Bounds, exact: bool = False, seed: int = 0
) -> SelfCollision:
    """Hulls and pairs of a URDF. Raises ExcitationError: no coal, no shapes, a mesh that is not there."""
    try:
        import coal
    except ImportError:
        raise ExcitationError("--self-collision needs coal; pip install 'dynident[collision]'.") from None
    hulls = tuple(_hull(coal, shape) for shape in shapes(source, exact))
    joined = _joined(robot)
    pairs = [
        (i, j)
        for i in range(len(hulls))
        for j in range(i)
        if hulls[i].row != hulls[j].row and (hulls[j].row, hulls[i].row) not in joined
    ]
    rng = np.random.default_rng([seed, 16])
    q = np.vstack([bounds.middle, rng.uniform(bounds.low, bounds.high, (POSTURES, robot.n))])
    f = frames(robot, q)
    apart = np.array([[_distance(hulls[i], hulls[j], f, k) > 0 for k in range(len(q))] for i, j in pairs])
    apart = apart.reshape(len(pairs), len(q))
    kept = [k for k, row in enumerate(apart) if row.mean() > 1 - ALWAYS]
    asked = tuple(pairs[k] for k in kept)
    names = [f"{hulls[i].link} and {hulls[j].link}" for k, (i, j) in enumerate(pairs) if k not in kept]
    made = SelfCollision(robot, hulls, asked, asked, tuple(dict.fromkeys(names)))
    if not kept:
        return made
    clear = made.smooth(f)[0] > 0
    useful = tuple(pairs[k] for m, k in enumerate(kept) if clear[apart[k], m].mean() > OFTEN)
    return replace(made, smooth_pairs=useful)


def _joined(robot: Robot) -> set[tuple[int, int]]:
    """Pairs of rows, both ways, that one moving joint joins, whatever fixed rows are between."""
    out = set()
    for row, link in enumerate(robot.links):
        above = link.antecedent - 1
        while above >= 0 and robot.links[above].sigma == 2:
            above = robot.links[above].antecedent - 1
        out |= {(row, above), (above, row)}
    return out


def _hull(coal: Any, shape: Shape) -> Hull:
    if shape.kind == "mesh":
        try:
            mesh = coal.MeshLoader().load(str(shape.file), np.array(shape.numbers))
            mesh.buildConvexHull(True, "Qt")
            made = mesh.convex
        except Exception:  # coal raises what its readers raise
            raise ExcitationError(
                f"--self-collision: the mesh {shape.file} of link {shape.link} cannot be read; export it "
                "again as STL or OBJ."
            ) from None
        points = np.array([made.point(k) for k in range(made.num_points)])
        a, b, r = enclosing(points)
    else:
        n = shape.numbers
        made, a, b, r = {
            "sphere": lambda: (coal.Sphere(n[0]), np.zeros(3), np.zeros(3), n[0]),
            "box": lambda: (coal.Box(*n), *enclosing(_corners(n))),
            "cylinder": lambda: (coal.Cylinder(n[0], n[1]), *enclosing(_rims(n))),
            "capsule": lambda: (coal.Capsule(n[0], n[1]), *_ends(n[1] / 2), n[0]),
        }[shape.kind]()
    return Hull(
        shape.link, shape.row, made, shape.R, shape.p, shape.R @ a + shape.p, shape.R @ b + shape.p, float(r)
    )


def _corners(size: Sequence[float]) -> Array:
    return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(size) / 2


def _rims(numbers: Sequence[float]) -> Array:
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    r = numbers[0] / np.cos(np.pi / 24)  # of a polygon around the circle
    return np.concatenate(
        [
            np.column_stack([r * np.cos(angle), r * np.sin(angle), 0 * angle + s * numbers[1] / 2])
            for s in (-1, 1)
        ]
    )


def _ends(half: float) -> tuple[Array, Array]:
    return np.array([0.0, 0.0, -half]), np.array([0.0, 0.0, half])


def enclosing(points: Array) -> tuple[Array, Array, float]:
    """A capsule around points (N, 3): its axis is their longest principal one."""
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    _, _, V = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    best = None
    for axis in V:
        along = (points - middle) @ axis
        across = (points - middle) - along[:, None] * axis
        centre = (across.max(axis=0) + across.min(axis=0)) / 2
        centre = centre - (centre @ axis) * axis
        beside = np.linalg.norm(across - centre, axis=1)
        r = float(beside.max()) * (1 + 1e-9) + 1e-9
        cap = np.sqrt(r * r - beside**2)
        low, high = float((along + cap).min()), float((along - cap).max())
        if low > high:  # a ball is enough
            low = high = (low + high) / 2
            r = float(np.sqrt((along - low) ** 2 + beside**2).max())
        size = r * r * (high - low + 4 * r / 3)
        if best is None or size < best[0]:
            best = (size, middle + centre + low * axis, middle + centre + high * axis, r)
    assert best is not None
    return best[1:]


def nearest(a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array]:
    """The nearest points (N, 3) of segments a to b and c to d, each (N, 3)."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = (np.einsum("ni,ni->n", x, y) for x, y in ((u, u), (v, v), (u, v)))
    uw, vw = np.einsum("ni,ni->n", u, w), np.einsum("ni,ni->n", v, w)
    skew = uu * vv - uv**2
    s = np.clip(np.where(skew > 1e-12, (uv * vw - vv * uw) / np.where(skew > 1e-12, skew, 1), 0.5), 0, 1)
    for _ in range(3):  # alternately, which ends exactly at segments' ends
        t = np.clip(np.where(vv > 1e-18, (uv * s + vw) / np.where(vv > 1e-18, vv, 1), 0.0), 0, 1)
        s = np.clip(np.where(uu > 1e-18, (uv * t - uw) / np.where(uu > 1e-18, uu, 1), 0.0), 0, 1)
    return a + s[:, None] * u, c + t[:, None] * v


def _placed(f: Frames, row: int, at: Array) -> Array:
    return np.broadcast_to(at, (len(f.p), 3)) if row < 0 else f.p[:, row] + f.R[:, row] @ at


def _distance(A: Hull, B: Hull, f: Frames, k: int) -> float:
    """m between two hulls in posture k; not positive where they touch."""
    import coal

    places = []
    for hull in (A, B):
        R, p = (np.eye(3), np.zeros(3)) if hull.row < 0 else (f.R[k, hull.row], f.p[k, hull.row])
        places.append(coal.Transform3s(R @ hull.R, p + R @ hull.p))
    found = coal.DistanceResult()
    return float(coal.distance(A.object, places[0], B.object, places[1], coal.DistanceRequest(), found))
