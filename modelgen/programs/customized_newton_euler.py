"""The regressor of one robot with as few operations as we know how.

A recursion on :class:`modelgen.programs.graph.Scalar`, for any MDH tree. It agrees with the plain
recursion of `newton_euler.py`, which is the definition; only the order of the work differs:

* The acceleration matrix U = [dw]x + [w]x[w]x of a link is its antecedent's, seen from the new frame, plus
  terms in dq, ddq that leave the third column alone: U_j z = R^T (U_a R z). Where z_j lies along an axis of
  frame a (twists of 0, +-pi/2, pi) that column costs one plane rotation, and with the products w_x w_z and
  w_y w_z it gives dw_x, dw_y and the whole matrix without rotating dw.
* A column's wrench is not carried down the chain. The axis of each ancestor is carried up, a_ij = z_i in
  frame j, and W_ij = a_ij . (n + r x f), the moment about a point of axis i, which is computed once for all
  axes through that point.
* A joint that slides its own origin along its axis (r_j) takes its first moments at the unshifted origin:
  MX_j's column = that of the unshifted origin - r XZ_j's column.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from modelgen.geometry.robot import Robot
from modelgen.programs.graph import Graph, Number, Scalar, dot

Vector = tuple[Scalar, Scalar, Scalar]
TENSOR = ("XX", "XY", "XZ", "YY", "YZ", "ZZ")
INERTIAL = (*TENSOR, "MX", "MY", "MZ", "M")


def number(value: sp.Expr) -> Number:
    """A constant of the robot: exact when rational, else the nearest double."""
    return Fraction(int(value.p), int(value.q)) if value.is_Rational else float(value)


@dataclass(frozen=True, slots=True)
class Rotation:
    """About one axis by an angle of known cosine and sine; `axis` 0 is x, 2 is z."""

    axis: int
    cos: Scalar
    sin: Scalar

    def up(self, v: Vector) -> Vector:
        """R^T v: from the antecedent's axes into the turned ones."""
        x, y, z = v
        c, s = self.cos, self.sin
        if self.axis == 2:
            return c * x + s * y, c * y - s * x, z
        return x, c * y + s * z, c * z - s * y

    def down(self, v: Vector) -> Vector:
        """R v."""
        return Rotation(self.axis, self.cos, -self.sin).up(v)


@dataclass(frozen=True, slots=True)
class Joint:
    """Row j, its constants as numbers: where it stands on its antecedent and how it moves."""

    index: int  # j
    antecedent: int
    sigma: int
    label: str  # k of q_k; "" on a fixed row
    rotations: tuple[Rotation, ...]  # applied in this order going up
    p: Vector  # from the antecedent's origin, in its frame, without r
    r: Scalar  # along z_j

    def up(self, v: Vector) -> Vector:
        for rotation in self.rotations:
            v = rotation.up(v)
        return v

    def down(self, v: Vector) -> Vector:
        for rotation in reversed(self.rotations):
            v = rotation.down(v)
        return v


def joints(robot: Robot, graph: Graph) -> tuple[Joint, ...]:
    """The rows of the MDH table as joints on `graph`. Inputs: c{k}, s{k} (revolute), q{k} (prismatic)."""
    zero = graph.zero
    found = []
    for j, link in enumerate(robot.links, 1):
        values = {key: robot.value(getattr(link, key)) for key in ("gamma", "b", "alpha", "d", "theta", "r")}
        label = str(link.variable)[1:] if link.variable else ""
        b, d, r = (graph.scalar(number(values[key])) for key in ("b", "d", "r"))
        gamma = Rotation(2, *_cos_sin(graph, values["gamma"]))
        alpha = Rotation(0, *_cos_sin(graph, values["alpha"]))
        theta = Rotation(2, *_cos_sin(graph, values["theta"]))
        if link.sigma == 0:
            c, s = graph.input(f"c{label}"), graph.input(f"s{label}")
            c0, s0 = theta.cos, theta.sin
            theta = Rotation(2, c * c0 - s * s0, s * c0 + c * s0)
        if link.sigma == 1:
            r = graph.input(f"q{label}") + r
        x, y, z = gamma.down((d, zero, zero))
        found.append(Joint(j, link.antecedent, link.sigma, label, (gamma, alpha, theta), (x, y, z + b), r))
    return tuple(found)


def _cos_sin(graph: Graph, angle: sp.Expr) -> tuple[Scalar, Scalar]:
    return graph.scalar(number(sp.cos(angle))), graph.scalar(number(sp.sin(angle)))


@dataclass(frozen=True, slots=True)
class Motion:
    """What the columns of a link need, in its own frame. U is the acceleration matrix [dw]x + [w]x[w]x."""

    w: Vector
    dw: Vector
    vd: Vector  # acceleration of the origin minus gravity
    vd_unshifted: Vector  # the same of the point that lies r below the origin on z_j
    U: tuple[Vector, Vector, Vector]  # columns
    ww: tuple[Scalar, Scalar, Scalar]  # wy wz, wx wz, wx wy
    differences: tuple[Scalar, Scalar, Scalar]  # wx^2 - wy^2, wz^2 - wx^2, wy^2 - wz^2


def forward(robot: Robot, graph: Graph, rows: Sequence[Joint]) -> list[Motion]:
    """Velocities and accelerations of every link, from the base up. Further inputs: dq{k}, ddq{k}."""
    zero = graph.zero
    none: Vector = (zero, zero, zero)
    gx, gy, gz = (-graph.scalar(number(robot.value(g))) for g in robot.gravity)
    motions = [Motion(none, none, (gx, gy, gz), (gx, gy, gz), (none, none, none), none, none)]
    for joint in rows:
        motions.append(_next(graph, joint, motions[joint.antecedent]))
    return motions


def _next(graph: Graph, joint: Joint, a: Motion) -> Motion:
    zero = graph.zero
    dq = graph.input(f"dq{joint.label}") if joint.label else zero
    ddq = graph.input(f"ddq{joint.label}") if joint.label else zero
    turning = joint.sigma == 0
    vd = tuple(v + dot(joint.p, row) for v, row in zip(a.vd, zip(*a.U)))
    vd_low = joint.up(vd)  # type: ignore[arg-type]
    x, y, z = joint.up(a.w)
    w: Vector = (x, y, z + dq) if turning else (x, y, z)
    axis = joint.down((zero, zero, graph.one))
    along = [k for k in range(3) if not axis[k].is_zero]
    ww = (w[1] * w[2], w[0] * w[2], w[0] * w[1])
    if len(along) == 1:  # z_j lies along an axis of frame a
        k = along[0]
        Uxz, Uyz, Uzz = joint.up(tuple(axis[k] * u for u in a.U[k]))  # type: ignore[arg-type]
        B, C = -Uyz, Uxz
        dwx, dwy = B + ww[0], C - ww[1]
        A, D = dwx + ww[0], dwy - ww[1]
        dwz = dot(axis, a.dw) + (ddq if turning else zero)
        xx, zz = w[0] * w[0], w[2] * w[2]
        Uyy = -(xx + zz)
        difference_y = zz - xx
        Uxx = Uzz - difference_y
        differences = (Uxx - Uyy, difference_y, Uyy - Uzz)
    else:
        dwx, dwy, dwz = joint.up(a.dw)
        if turning:
            dwx, dwy, dwz = dwx + w[1] * dq, dwy - w[0] * dq, dwz + ddq
        A, B, C, D = dwx + ww[0], dwx - ww[0], dwy + ww[1], dwy - ww[1]
        xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
        Uxx, Uyy, Uzz = -(yy + zz), -(xx + zz), -(xx + yy)
        differences = (xx - yy, zz - xx, yy - zz)
    E, F = dwz + ww[2], dwz - ww[2]
    U = ((Uxx, E, -D), (-F, Uyy, A), (C, -B, Uzz))
    if joint.sigma == 1:  # both points of z_j slide along
        twice = dq + dq
        extra = (w[1] * twice, -(w[0] * twice), ddq)
        vd_low = tuple(v + e for v, e in zip(vd_low, extra))  # type: ignore[assignment]
    vd_j = tuple(v + joint.r * u for v, u in zip(vd_low, U[2]))
    return Motion(w, (dwx, dwy, dwz), vd_j, vd_low, U, ww, differences)  # type: ignore[arg-type]


def moment_column(m: Motion, name: str) -> Vector:
    """Moment about the link's origin per unit of the inertia tensor's component `name`, in frame j."""
    (wywz, wxwz, wxwy), (xy, zx, yz) = m.ww, m.differences
    dwx, dwy, dwz = m.dw
    (_, E, minus_D), (minus_F, _, A), (C, minus_B, _) = m.U
    match name:
        case "XX":
            return dwx, wxwz, -wxwy
        case "XY":
            return -minus_D, A, xy
        case "XZ":
            return E, zx, -minus_B
        case "YY":
            return -wywz, dwy, wxwy
        case "YZ":
            return yz, -minus_F, C
        case "ZZ":
            return wywz, -wxwz, dwz
    raise KeyError(name)


def wrench_column(graph: Graph, m: Motion, name: str, vd: Vector) -> tuple[Vector, Vector | None]:
    """(moment, force) per unit of parameter `name`; `vd` is the acceleration of their point."""
    zero = graph.zero
    x, y, z = vd
    match name:
        case "MX":
            return (zero, -z, y), m.U[0]
        case "MY":
            return (z, zero, -x), m.U[1]
        case "MZ":
            return (-y, x, zero), m.U[2]
        case "M":
            return (zero, zero, zero), vd
    return moment_column(m, name), None


@dataclass(frozen=True, slots=True)
class Choices:
    """Ways to the same numbers that cost differently from robot to robot; the cheapest is kept."""

    shift: bool = True  # first moments of a sliding origin taken at the unshifted one
    share: int = 2  # axes through one point before the moment about it is worth its own computation
    shifted: frozenset[int] = frozenset()  # torque: links whose wrench is taken at the unshifted origin
    lines: bool = False  # torque: second moments along joint axes are moved to the antecedent first


DEFAULT = Choices()


def regressor(
    robot: Robot, graph: Graph, columns: Mapping[int, Sequence[str]], choices: Choices = DEFAULT
) -> dict[tuple[str, int, str], Scalar]:
    """Torque of joint k per unit of parameter `name` of link j: {(k, j, name): scalar}, zeros left out.

    `columns`: link number -> names among XX ... M.
    """
    rows = joints(robot, graph)
    motions = forward(robot, graph, rows)
    found: dict[tuple[str, int, str], Scalar] = {}
    axes: dict[tuple[int, int], Vector] = {}
    arms: dict[tuple[int, int], Vector] = {}
    zero = graph.zero
    for joint in rows:
        j = joint.index
        above = [i for i in robot.ancestors(j) if i != j]
        for i in above:
            a = joint.antecedent
            axes[i, j] = joint.up(axes[i, a])
            arm = joint.up(tuple(u + v for u, v in zip(arms[i, a], joint.p)))  # type: ignore[arg-type]
            arms[i, j] = (arm[0], arm[1], arm[2] + joint.r)
        axes[j, j] = (zero, zero, graph.one)
        arms[j, j] = (zero, zero, zero)
        names = columns.get(j, ())
        if names:
            _link_entries(robot, graph, rows, joint, motions[j], names, axes, arms, choices, found)
    return {key: value for key, value in found.items() if not value.is_zero}


def _link_entries(
    robot: Robot,
    graph: Graph,
    rows: Sequence[Joint],
    joint: Joint,
    m: Motion,
    names: Sequence[str],
    axes: Mapping[tuple[int, int], Vector],
    arms: Mapping[tuple[int, int], Vector],
    choices: Choices,
    found: dict[tuple[str, int, str], Scalar],
) -> None:
    """The entries of link j in the rows of its ancestors and its own."""
    j = joint.index
    zero = graph.zero
    turning = [i for i in robot.ancestors(j) if rows[i - 1].sigma == 0]
    sharing: dict[tuple, int] = {}
    for i in turning:
        key = tuple(x.key for x in arms[i, j])
        sharing[key] = sharing.get(key, 0) + 1
    moments: dict[tuple, Vector] = {}
    for i in robot.ancestors(j):
        row = rows[i - 1]
        if row.sigma == 2:
            continue
        a, arm = axes[i, j], arms[i, j]
        still = all(x.is_zero for x in arm)
        along_z = arm[0].is_zero and arm[1].is_zero and arm[2].key == joint.r.key and i != j
        tensor = {name: dot(a, moment_column(m, name)) for name in TENSOR} if row.sigma == 0 else {}
        for name in names:
            if row.sigma == 1:
                _, force = wrench_column(graph, m, name, m.vd)
                value = zero if force is None else dot(a, force)
            elif name in TENSOR:
                value = tensor[name]
            elif still:
                value = dot(a, wrench_column(graph, m, name, m.vd)[0])
            elif along_z and choices.shift and name in ("MX", "MY"):
                value = dot(a, wrench_column(graph, m, name, m.vd_unshifted)[0])
                value = value - arm[2] * tensor["XZ" if name == "MX" else "YZ"]
            else:
                n, force = wrench_column(graph, m, name, m.vd)
                assert force is not None
                key = tuple(x.key for x in arm)
                if sharing[key] >= choices.share:
                    about = moments.get((key, name))
                    if about is None:
                        about = moments[key, name] = tuple(u + v for u, v in zip(n, cross(arm, force)))  # type: ignore[assignment]
                    value = dot(a, about)  # type: ignore[arg-type]
                else:
                    value = dot(a, n) + dot(cross(a, arm), force)
            found[row.label, j, name] = value


def cross(u: Vector, v: Vector) -> Vector:
    """u x v"""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def plus(u: Vector, v: Vector) -> Vector:
    """u + v"""
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]
