"""Geometry and state of an MDH chain as plain numbers of any type, and the vector algebra they need.

The number type is open: floats, NumPy arrays (one entry per sample), fractions, SymPy or CasADi symbols.
Only the Python integers 0, 1 and -1 are structural: a product with them is not written down, so an expression
built here holds no multiplication by the zeros and ones of the robot's geometry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import sympy as sp

    from modelgen.geometry.robot import Robot

Number = Any
Vector = tuple[Number, Number, Number]

NULL: Vector = (0, 0, 0)


def mul(a: Number, b: Number) -> Number:
    """a b, without writing a product with a structural 0, 1 or -1."""
    for factor, other in ((a, b), (b, a)):
        if isinstance(factor, int):
            if factor == 0:
                return 0
            if factor == 1:
                return other
            if factor == -1:
                return -other
    return a * b


def add(a: Number, b: Number) -> Number:
    """a + b, without writing a sum with a structural 0."""
    if isinstance(a, int) and a == 0:
        return b
    if isinstance(b, int) and b == 0:
        return a
    return a + b


def sub(a: Number, b: Number) -> Number:
    """a - b, without writing a structural 0."""
    if isinstance(b, int) and b == 0:
        return a
    if isinstance(a, int) and a == 0:
        return -b
    return a - b


def plus(u: Vector, v: Vector) -> Vector:
    """u + v."""
    return add(u[0], v[0]), add(u[1], v[1]), add(u[2], v[2])


def dot(u: Vector, v: Vector) -> Number:
    """u . v."""
    return add(add(mul(u[0], v[0]), mul(u[1], v[1])), mul(u[2], v[2]))


def cross(u: Vector, v: Vector) -> Vector:
    """u x v."""
    return (
        sub(mul(u[1], v[2]), mul(u[2], v[1])),
        sub(mul(u[2], v[0]), mul(u[0], v[2])),
        sub(mul(u[0], v[1]), mul(u[1], v[0])),
    )


def apply(matrix: Sequence[Vector], v: Vector) -> Vector:
    """Matrix (three rows) times v."""
    return dot(matrix[0], v), dot(matrix[1], v), dot(matrix[2], v)


def _turn(c: Number, s: Number, x: Number, y: Number) -> tuple[Number, Number]:
    return sub(mul(c, x), mul(s, y)), add(mul(s, x), mul(c, y))


def _turn_back(c: Number, s: Number, x: Number, y: Number) -> tuple[Number, Number]:
    return add(mul(c, x), mul(s, y)), sub(mul(c, y), mul(s, x))


@dataclass(frozen=True, slots=True)
class Row:
    """One MDH row as numbers: cos and sin of gamma, alpha and the constant theta; b, d, r."""

    antecedent: int
    sigma: int
    c_gamma: Number
    s_gamma: Number
    b: Number
    c_alpha: Number
    s_alpha: Number
    d: Number
    c_theta: Number
    s_theta: Number
    r: Number


@dataclass(frozen=True, slots=True)
class Geometry:
    """All rows of a robot as numbers, and gravity (base frame, m/s^2)."""

    rows: tuple[Row, ...]
    gravity: Vector

    @property
    def moving(self) -> tuple[int, ...]:
        """Indices (from 0) of the moving rows, in the order of q."""
        return tuple(j for j, row in enumerate(self.rows) if row.sigma != 2)

    @classmethod
    def of(cls, written: Mapping[str, Any]) -> Geometry:
        """What `document` wrote."""
        return cls(tuple(Row(*row) for row in written["rows"]), tuple(written["gravity"]))

    def document(self) -> dict[str, Any]:
        """A geometry of floats as plain values; integers stay integers."""
        rows = [[getattr(row, f.name) for f in fields(Row)] for row in self.rows]
        return {"rows": rows, "gravity": list(self.gravity)}

    def mapped(self, convert: Callable[[Number], Number]) -> Geometry:
        """The same geometry in another number type; structural integers stay as they are."""

        def lift(x: Number) -> Number:
            return x if isinstance(x, int) else convert(x)

        rows = tuple(
            Row(r.antecedent, r.sigma, *(lift(getattr(r, f.name)) for f in fields(Row)[2:]))
            for r in self.rows
        )
        x, y, z = self.gravity
        return Geometry(rows, (lift(x), lift(y), lift(z)))


@dataclass(frozen=True, slots=True)
class State:
    """State of the moving joints, in the order of q, each a sequence of n numbers.

    c, s: cos and sin of theta_j = q_j + offset (revolute; ignored elsewhere); q: position of the prismatic
    joints (ignored elsewhere); dq, ddq: rates and accelerations.
    """

    c: Sequence[Number]
    s: Sequence[Number]
    q: Sequence[Number]
    dq: Sequence[Number]
    ddq: Sequence[Number]


@dataclass(frozen=True, slots=True)
class Transform:
    """T(a(j), j) at a state: turns vectors of frame j into a(j) and back; p is the origin of j in a(j)."""

    row: Row
    c: Number
    s: Number
    p: Vector

    def to_antecedent(self, v: Vector) -> Vector:
        """Rot_z(gamma) Rot_x(alpha) Rot_z(theta) v."""
        x, y = _turn(self.c, self.s, v[0], v[1])
        y, z = _turn(self.row.c_alpha, self.row.s_alpha, y, v[2])
        x, y = _turn(self.row.c_gamma, self.row.s_gamma, x, y)
        return x, y, z

    def to_link(self, v: Vector) -> Vector:
        """Rot_z(-theta) Rot_x(-alpha) Rot_z(-gamma) v."""
        x, y = _turn_back(self.row.c_gamma, self.row.s_gamma, v[0], v[1])
        y, z = _turn_back(self.row.c_alpha, self.row.s_alpha, y, v[2])
        x, y = _turn_back(self.c, self.s, x, y)
        return x, y, z


def geometry(robot: Robot, number: Callable[[sp.Expr], Number] = float) -> Geometry:
    """The robot's constants as numbers; `number` turns an exact SymPy value into one (default float).

    0, 1 and -1 become Python integers, so that they stay structural. Named constants are replaced by their
    values; `symbolic_geometry` keeps them.
    """

    def lift(expression: sp.Expr) -> Number:
        value = robot.value(expression)
        if value in (0, 1, -1):
            return int(value)
        return number(value)

    return _geometry(robot, lift)


def symbolic_geometry(robot: Robot, number: Callable[[sp.Expr], Number] = lambda e: e) -> Geometry:
    """As `geometry`, with the named constants left as symbols."""
    return _geometry(robot, lambda e: int(e) if e in (0, 1, -1) else number(e))


def _geometry(robot: Robot, lift: Callable[[sp.Expr], Number]) -> Geometry:
    import sympy as sp  # not at the top: who has the numbers (`Geometry.of`) needs no symbols

    rows = tuple(
        Row(
            antecedent=link.antecedent - 1,  # counted from 0 here; the base is -1
            sigma=link.sigma,
            c_gamma=lift(sp.cos(link.gamma)),
            s_gamma=lift(sp.sin(link.gamma)),
            b=lift(link.b),
            c_alpha=lift(sp.cos(link.alpha)),
            s_alpha=lift(sp.sin(link.alpha)),
            d=lift(link.d),
            c_theta=lift(sp.cos(link.theta)),
            s_theta=lift(sp.sin(link.theta)),
            r=lift(link.r),
        )
        for link in robot.links
    )
    x, y, z = (lift(g) for g in robot.gravity)
    return Geometry(rows, (x, y, z))


def transforms(geometry: Geometry, state: State) -> tuple[Transform, ...]:
    """T(a(j), j) of every row at `state`."""
    index = {j: i for i, j in enumerate(geometry.moving)}
    result = []
    for j, row in enumerate(geometry.rows):
        c, s, r = row.c_theta, row.s_theta, row.r
        if row.sigma == 0:
            c, s = state.c[index[j]], state.s[index[j]]
        elif row.sigma == 1:
            r = add(state.q[index[j]], r)
        # p = Rot_z(gamma) (d, -sin(alpha) r, b + cos(alpha) r)
        x, y = _turn(row.c_gamma, row.s_gamma, row.d, sub(0, mul(row.s_alpha, r)))
        result.append(Transform(row, c, s, (x, y, add(row.b, mul(row.c_alpha, r)))))
    return tuple(result)


def state(robot: Robot, q: Any, dq: Any, ddq: Any) -> State:
    """State of float arrays (n,) or (N, n); its numbers are scalars or arrays over the N samples."""
    import numpy as np

    q, dq, ddq = (np.asarray(x, dtype=float) for x in (q, dq, ddq))
    offset = np.array([float(robot.value(robot.link(j).theta)) for j in robot.moving])
    columns = [tuple(np.moveaxis(x, -1, 0)) for x in (np.cos(q + offset), np.sin(q + offset), q, dq, ddq)]
    return State(*columns)
