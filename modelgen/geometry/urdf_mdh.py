"""From a URDF's tree to rows of Khalil's modified Denavit-Hartenberg table, exactly, for any joint axes.

Frame j stands on joint j's axis, z along it as the URDF has it, so theta_j = q_j + constant with the URDF's
own q_j: no sign is turned. For a joint whose axis has direction u and passes through P in frame a,

    T(a, j) = Rot_z(gamma) Trans_z(b) Rot_x(alpha) Trans_x(d) Rot_z(theta) Trans_z(r)

follows from the common normal x' of z_a and u: gamma turns x_a to it, b leads to its foot on z_a, alpha turns
z_a to u about it and d is its length (Khalil and Kleinfinger 1986). The free turn and shift of frame a along
its own axis are used to make gamma = b = 0 for one child, that with most joints behind it; its siblings keep
theirs. Axes that are almost but not quite parallel would have their common normal far away, where digits are
lost: such a row gets a fixed row between, whose z is across.

All is computed with 60 digits and written with 40, so what should be zero is zero and a decimal of the URDF
is that decimal. Unless `exact`, angles within 2e-5 rad of a multiple of pi/2 (URDFs round pi), in the URDF
and in the table, and within 1e-9 of one of pi/12 in the URDF are taken as those, and lengths below 1e-9 m
as zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import mpmath
import sympy as sp

from modelgen.errors import ModelgenError
from modelgen.geometry.robot import ZERO, Link
from modelgen.geometry.urdf_file import Inertial, Joint, Triple, Urdf

MP = mpmath.MPContext()
MP.dps = 60
WRITTEN = 40  # digits
NOTHING = MP.mpf(10) ** -45
DOUBLE = MP.mpf(10) ** -15  # rad: pi as doubles print it
TURN, FINE, SHORT = MP.mpf("2e-5"), MP.mpf("1e-9"), MP.mpf("1e-9")  # rad, rad, m
FAR = 20  # times the distance of the axes' points
MOST_ROWS = 64
SECOND = {"XX": (0, 0), "XY": (0, 1), "XZ": (0, 2), "YY": (1, 1), "YZ": (1, 2), "ZZ": (2, 2)}

Matrix = Any  # of MP
Vector = tuple[Any, Any, Any]


@dataclass(frozen=True, slots=True)
class Frame:
    """Rotation (rows) and origin (m) of a frame seen from another: v -> R v + p."""

    R: tuple[Vector, Vector, Vector]
    p: Vector

    def turned(self, v: Vector) -> Vector:
        """R v."""
        x, y, z = (sum((a * b for a, b in zip(row, v)), MP.zero) for row in self.R)
        return x, y, z

    def __matmul__(self, other: Frame) -> Frame:
        columns = [self.turned(column) for column in zip(*other.R)]
        rows: Any = tuple(zip(*columns))
        moved = self.turned(other.p)
        return Frame(rows, _plus(moved, self.p))

    def inverse(self) -> Frame:
        """The other frame seen from this one."""
        rows: Any = tuple(zip(*self.R))
        back = Frame(rows, (MP.zero,) * 3).turned(self.p)
        return Frame(rows, (-back[0], -back[1], -back[2]))


@dataclass(frozen=True, slots=True)
class Angle:
    """An angle as it is written (exact where it is a simple part of pi) and as 60 digits."""

    written: sp.Expr
    value: Any
    cos: Any
    sin: Any


@dataclass(frozen=True, slots=True)
class Body:
    """A moving joint with what it carries: row of the table, name, the MDH frame seen from the URDF's child
    link, and the links that are fixed together with their frames seen from that child link."""

    row: int
    joint: str
    link: str
    frame: Frame
    links: tuple[tuple[str, Frame], ...]


@dataclass(frozen=True, slots=True)
class Table:
    """The MDH rows of a URDF, its bodies in the order of q, and the greatest snaps: rad and m, by joint."""

    rows: tuple[Link, ...]
    bodies: tuple[Body, ...]
    turned: dict[str, float]
    shortened: dict[str, float]


@dataclass(slots=True)
class _Work:
    """What grows while the tree is walked."""

    urdf: Urdf
    exact: bool
    rows: list[Link] = field(default_factory=list)
    bodies: list[Body] = field(default_factory=list)
    turned: dict[str, float] = field(default_factory=dict)
    shortened: dict[str, float] = field(default_factory=dict)
    moving: int = 0
    weight: dict[str, int] = field(default_factory=dict)


def table(urdf: Urdf, exact: bool = False) -> Table:
    """Rows for every moving joint, depth first in the file's order. Raises ModelgenError."""
    work = _Work(urdf, exact)
    _weigh(work)
    if sum(joint.kind != "fixed" for joints in urdf.children.values() for joint in joints) > MOST_ROWS:
        raise ModelgenError(f"has more than {MOST_ROWS} moving joints; describe one limb of the robot")
    _, joints = _carried(work, urdf.root)
    for joint, place in joints:
        _add(work, 0, joint, place)
    if len(work.rows) > MOST_ROWS:
        raise ModelgenError(f"needs more than {MOST_ROWS} rows; describe one limb of the robot")
    return Table(tuple(work.rows), tuple(work.bodies), work.turned, work.shortened)


def _weigh(work: _Work) -> None:
    """Moving joints at and behind each joint."""
    children = work.urdf.children
    waiting = list(children.get(work.urdf.root, ()))
    walked: list[Joint] = []
    while waiting:
        joint = waiting.pop()
        walked.append(joint)
        waiting += children.get(joint.child, ())
    for joint in reversed(walked):
        behind = sum(work.weight[next_one.name] for next_one in children.get(joint.child, ()))
        work.weight[joint.name] = behind + (joint.kind != "fixed")


def _carried(work: _Work, link: str) -> tuple[list[tuple[str, Frame]], list[tuple[Joint, Frame]]]:
    """Links fixed to `link`, itself first, and the moving joints that leave them, as seen from it."""
    links, joints = [], []
    waiting = [(link, IDENTITY)]
    while waiting:
        name, place = waiting.pop(0)
        links.append((name, place))
        for joint in work.urdf.children.get(name, ()):
            at = place @ _origin(work, joint)
            if joint.kind == "fixed":
                waiting.append((joint.child, at))
            else:
                joints.append((joint, at))
    return links, joints


def _add(work: _Work, antecedent: int, joint: Joint, place: Frame) -> None:
    """Rows of `joint`, whose frame stands at `place` in its antecedent's MDH frame, and of all behind it."""
    stack = [(antecedent, joint, place, False)]
    while stack:
        above, joint, place, primary = stack.pop()
        axis = _axis(work, joint)
        u = place.turned(axis)
        fitted = _row(work, joint, u, place.p, primary)
        if fitted is None:  # almost parallel: a fixed row across
            name = f"across_{joint.name}"
            work.rows.append(Link(name, "fixed", above, alpha=sp.pi / 2))
            above, across = len(work.rows), _screw_x(_angle(work, joint, MP.pi / 2), MP.zero)
            place = across.inverse() @ place
            u = place.turned(axis)
            fitted = _row(work, joint, u, place.p, False)
            assert fitted is not None
        gamma, b, alpha, d = fitted
        on_axis = _screw_z(gamma, b) @ _screw_x(alpha, d)  # theta = r = 0
        links, joints = _carried(work, joint.child)
        seen = place.inverse() @ on_axis  # that frame from the child link
        theta, r, first = _free(work, joint, seen, joints)
        frame = seen @ _screw_z(theta, r)
        work.moving += 1
        work.rows.append(
            Link(
                joint.name, joint.kind, above, gamma.written, _decimal(b), alpha.written,
                _decimal(d), theta.written, _decimal(r), f"q{work.moving}", joint.limits,
            )
        )  # fmt: skip
        row = len(work.rows)
        work.bodies.append(Body(row, joint.name, joint.child, frame, tuple(links)))
        back = frame.inverse()
        stack += [(row, child, back @ at, child is first) for child, at in reversed(joints)]


def _free(
    work: _Work, joint: Joint, seen: Frame, joints: list[tuple[Joint, Frame]]
) -> tuple[Angle, Any, Joint | None]:
    """theta, r of a row such that gamma = b = 0 for one joint behind it, and that joint.

    Where there is none the frame is the child link's as far as the axis lets it: its origin, and its first
    axis that is square to the joint's.
    """
    best = max(joints, key=lambda pair: work.weight[pair[0].name], default=None)
    if best is not None:
        at = seen.inverse() @ best[1]
        fitted = _row(work, best[0], at.turned(_axis(work, best[0])), at.p, False)
        if fitted is not None:
            return fitted[0], fitted[1], best[0]
    back = seen.inverse()
    r = _near_zero(work, joint, back.p[2])
    for k in range(3):
        x = back.turned(tuple(MP.mpf(int(i == k)) for i in range(3)))  # type: ignore[arg-type]
        if abs(x[2]) < TURN:
            return _angle(work, joint, MP.atan2(x[1], x[0])), r, None
    return _angle(work, joint, MP.zero), r, None


def _row(
    work: _Work, joint: Joint, u: Vector, P: Vector, primary: bool
) -> tuple[Angle, Any, Angle, Any] | None:
    """gamma, b, alpha, d that lead z to the line through P along u; None where a fixed row must help.

    `primary`: frame a was chosen so that gamma = b = 0.
    """
    tilt = MP.hypot(u[0], u[1])
    parallel = tilt < (DOUBLE if work.exact else TURN)
    if parallel:
        offset = MP.hypot(P[0], P[1])
        none = offset < (NOTHING if work.exact else SHORT)
        normal = (MP.one, MP.zero) if none else (P[0] / offset, P[1] / offset)
    else:
        normal = (-u[1] / tilt, u[0] / tilt)
    if normal[0] < -NOTHING or (abs(normal[0]) <= NOTHING and normal[1] < 0):
        normal = (-normal[0], -normal[1])  # gamma within a quarter turn
    gamma = _angle(work, joint, MP.zero if primary else MP.atan2(normal[1], normal[0]))
    along = _near_zero(work, joint, P[0] * gamma.cos + P[1] * gamma.sin)
    across = P[1] * gamma.cos - P[0] * gamma.sin
    if parallel:
        alpha = _angle(work, joint, MP.zero if u[2] > 0 else MP.pi)
        return gamma, MP.zero, alpha, along
    alpha = _angle(work, joint, MP.atan2(u[0] * gamma.sin - u[1] * gamma.cos, u[2]))
    b = MP.zero if primary else _near_zero(work, joint, P[2] + across * alpha.cos / alpha.sin)
    if abs(b) > FAR * (abs(P[0]) + abs(P[1]) + abs(P[2])) + MP.one and abs(alpha.sin) < 0.1:
        return None
    return gamma, b, alpha, along


def _axis(work: _Work, joint: Joint) -> Vector:
    """Unit direction; a component that turns it by less than 2e-5 rad is left out."""
    x, y, z = (MP.mpf(v.numerator) / v.denominator for v in joint.axis)
    size = MP.sqrt(x * x + y * y + z * z)
    unit = (x / size, y / size, z / size)
    if not work.exact:
        for k in range(3):
            rest = MP.hypot(*(unit[i] for i in range(3) if i != k))
            if 0 < rest < TURN:
                _note(work, work.turned, joint, rest)
                return tuple(MP.sign(unit[k]) if i == k else MP.zero for i in range(3))  # type: ignore[return-value]
    return unit


def _origin(work: _Work, joint: Joint) -> Frame:
    """The joint's frame in its parent link: Rot_z(yaw) Rot_y(pitch) Rot_x(roll) at xyz."""

    def angle(value: Fraction) -> Angle:
        return _angle(work, joint, MP.mpf(value.numerator) / value.denominator, written=True)

    return origin_frame(joint.xyz, joint.rpy, angle, lambda x: _near_zero(work, joint, x))


def origin_frame(
    xyz: Triple, rpy: Triple, angle: Callable[[Fraction], Any], length: Callable[[Any], Any] = lambda x: x
) -> Frame:
    """The frame of an <origin>; `angle` gives cos and sin, `length` may replace a coordinate."""
    roll, pitch, yaw = (angle(value) for value in rpy)
    turn = Frame(IDENTITY.R, IDENTITY.p)
    for axis, a in ((2, yaw), (1, pitch), (0, roll)):
        turn = turn @ Frame(_rotation(axis, a.cos, a.sin), IDENTITY.p)
    x, y, z = (length(MP.mpf(v.numerator) / v.denominator) for v in xyz)
    return Frame(turn.R, (x, y, z))


def _angle(work: _Work, joint: Joint, value: Any, written: bool = False) -> Angle:
    """`value` rad, taken as a simple part of pi where it is one; `written`: as it stands in the URDF."""
    for parts, tolerance in ((2, TURN), (12, FINE if written else DOUBLE)):
        k = int(MP.nint(value * parts / MP.pi))
        off = abs(value - k * MP.pi / parts)
        if off <= (DOUBLE if work.exact else tolerance):
            if off > DOUBLE:
                _note(work, work.turned, joint, off)
            exact = sp.pi * sp.Rational(k, parts)
            turn = MP.pi * k / parts
            cos, sin = MP.cos(turn), MP.sin(turn)
            return Angle(exact, turn, *(MP.zero if abs(x) < NOTHING else x for x in (cos, sin)))
    number = _decimal(value)
    return Angle(number, value, MP.cos(value), MP.sin(value))


def _near_zero(work: _Work, joint: Joint, x: Any) -> Any:
    if 0 < abs(x) < SHORT and not work.exact:
        if abs(x) > DOUBLE:
            _note(work, work.shortened, joint, abs(x))
        return MP.zero
    return x


def _decimal(x: Any) -> sp.Expr:
    """The decimal of 40 digits; what cancelled is zero."""
    return ZERO if abs(x) < NOTHING else sp.Rational(MP.nstr(x, WRITTEN, strip_zeros=True))


def _note(work: _Work, noted: dict[str, float], joint: Joint, size: Any) -> None:
    if work.weight[joint.name]:  # nothing moves behind the others
        noted[joint.name] = max(noted.get(joint.name, 0.0), float(size))


def _rotation(axis: int, c: Any, s: Any) -> tuple[Vector, Vector, Vector]:
    one, zero = MP.one, MP.zero
    if axis == 0:
        return (one, zero, zero), (zero, c, -s), (zero, s, c)
    if axis == 1:
        return (c, zero, s), (zero, one, zero), (-s, zero, c)
    return (c, -s, zero), (s, c, zero), (zero, zero, one)


def _screw_z(angle: Angle, length: Any) -> Frame:
    return Frame(_rotation(2, angle.cos, angle.sin), (MP.zero, MP.zero, length))


def _screw_x(angle: Angle, length: Any) -> Frame:
    return Frame(_rotation(0, angle.cos, angle.sin), (length, MP.zero, MP.zero))


def _plus(u: Vector, v: Vector) -> Vector:
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


IDENTITY = Frame(_rotation(2, MP.one, MP.zero), (MP.zero, MP.zero, MP.zero))


def inertial_parameters(body: Body, inertials: dict[str, Inertial | None]) -> dict[str, float]:
    """XX ... M of all links of a body together, about its MDH frame's origin in its axes (kg, m)."""
    total = dict.fromkeys((*SECOND, "MX", "MY", "MZ", "M"), MP.zero)
    back = body.frame.inverse()
    for name, place in body.links:
        inertial = inertials[name]
        if inertial is None:
            continue
        at = back @ place @ origin_frame(inertial.xyz, inertial.rpy, _plain_angle)
        m = MP.mpf(inertial.mass.numerator) / inertial.mass.denominator
        xx, xy, xz, yy, yz, zz = (MP.mpf(v.numerator) / v.denominator for v in inertial.inertia)
        columns = [at.turned(row) for row in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))]  # R I, by columns
        inertia = [at.turned(row) for row in zip(*columns)]  # type: ignore[arg-type]  # R (R I)^T
        c = at.p
        square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2]
        for kind, (i, k) in SECOND.items():
            total[kind] += inertia[i][k] + m * ((square if i == k else 0) - c[i] * c[k])
        for kind, value in zip(("MX", "MY", "MZ"), c):
            total[kind] += m * value
        total["M"] += m
    return {kind: float(value) for kind, value in total.items()}


@dataclass(frozen=True, slots=True)
class _Plain:
    cos: Any
    sin: Any


def _plain_angle(value: Fraction) -> _Plain:
    x = MP.mpf(value.numerator) / value.denominator
    return _Plain(MP.cos(x), MP.sin(x))
