"""Regrouping of the inertial parameters: which combinations no motion can tell apart, exactly.

A body is a symmetric 4 x 4 matrix P = [[S, ms], [ms', M]] (pseudo-inertia; S the second moments). With T the
frame of the body and V = T^-1 dT/dt its velocity, both energies are traces (Fu, Gonzalez and Lee 1987, ch. 3):

    kinetic 1/2 tr(V'V P)              potential -tr(G P),  G = sym(e4 (g, 0)' T)

and seen from the antecedent, T_j = T_a F J(q) (F the constant part of the MDH row, J the joint), a body P of link
j is the body F J P J' F' of link a. What no torque shows is a set of bodies (and rotors) whose kinetic energies
add up to zero and whose potential energies add up to a constant.

**Theorem.** Such sets are the sums of *transfers*: a body P of link j whose energies do not depend on q_j and
dq_j, for any motion that link a(j) can do, against the same body held by link a(j).
Proof: in an unobservable set take a link n without descendants. No other link's energy depends on q_n and dq_n,
so its own cannot either; being constant in q_n they equal their average over q_n (a prismatic joint: their value
at q_n = 0), which is the energy of one body held by a(n). Replace it and repeat on the smaller tree; a body held
by the base has no kinetic and a constant potential energy, and is dropped. No step divides or rounds.

So everything is decided link by link, from the functionals V'V and G and the velocities V that a's motion can
produce: two spaces that follow exactly from the antecedent's, because J'SJ is a trigonometric polynomial of
degree 2 in q (five points of the circle span its coefficients) or a polynomial of degree 2 (three points), and
because four quarter turns average it exactly.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import sympy as sp
from sympy.polys.domains import QQ

from modelgen.exact import Exact, Span, product, transposed
from modelgen.kinematics import Geometry, Number, Row, State, symbolic_geometry, transforms
from modelgen.newton_euler import INERTIAL
from modelgen.robot import Robot

Matrix = list[list[Number]]
Coordinates = dict[str, Number]  # parameter name -> coefficient

# Which of a link's parameters keep their columns, if a relation leaves the choice; the paper's table keeps XX, ZZ,
# MX and MY of a revolute link and gives up YY, MZ, M, and Iam before ZZ. By sigma.
KEPT_FIRST = {
    0: ("ZZ", "MX", "MY", "XX", "XY", "XZ", "YZ", "Iam", "YY", "MZ", "M"),
    1: ("M", "MX", "MY", "MZ", "Iam", "ZZ", "YZ", "YY", "XZ", "XY", "XX"),
    2: INERTIAL,
}
PAYLOAD_KEPT_FIRST = ("M", "MX", "MY", "MZ", "ZZ", "XX", "YY", "XY", "XZ", "YZ")
QUARTER_TURNS = ((1, 0), (0, 1), (-1, 0), (0, -1))
CIRCLE = (*QUARTER_TURNS, (QQ(3, 5), QQ(4, 5)))
LINE = (0, 1, -1)


@dataclass(frozen=True, slots=True)
class InertialRegrouping:
    """Every inertial parameter (and rotor inertia) as a combination of those kept.

    columns["YY3"] == {"XX2": 1, "ZZ2": 1, "XX3": -1, ...} says that the regressor's column of YY3 equals this
    combination of kept columns; an empty one that it vanishes. The coefficients are exact.
    """

    exact: Exact
    columns: dict[str, Coordinates]
    reach: tuple[Reach, ...]  # by row number

    @property
    def kept(self) -> tuple[str, ...]:
        """The parameters whose columns are kept."""
        return tuple(name for name, c in self.columns.items() if c == {name: 1})


@dataclass(frozen=True, slots=True)
class Reach:
    """What the motion of one link can show of a body that it holds, in the axes of one frame.

    shown: the span in Sym(4) of its kinetic functionals V'V and of the differences of its G between two states;
    weight: G at one state (upper triangle); L: the span in se(3) of its velocities V.
    """

    shown: Span
    weight: list[Number]
    L: Span


def regroup_inertial(robot: Robot, rotors: bool) -> InertialRegrouping:
    """Exact relations among the inertial parameters of `robot`, with each joint's Iam if `rotors`.

    A rotor's kinetic energy is Iam dq^2 / 2 (paper eq. 1: it acts in its own row only).
    """
    geometry, exact = exact_geometry(robot)
    gx, gy, gz = geometry.gravity
    weight = [[0, 0, 0, gx], [0, 0, 0, gy], [0, 0, 0, gz], [gx, gy, gz, 0]]
    reach = [Reach(Span(10), _upper(weight), Span(6))]  # by row number; 0 is the base
    label = dict(zip(robot.moving, robot.joint_labels, strict=True))
    columns: dict[str, Coordinates] = {}
    for j, row in enumerate(geometry.rows, 1):
        a = row.antecedent + 1
        F = _frame(geometry, j - 1)
        held = _behind(F, reach[a])
        rotor = label.get(j) if rotors else None
        columns.update(_link_columns(j, a, row, F, held, rotor, columns, exact))
        reach.append(_moved(held, row.sigma))
    return InertialRegrouping(exact, columns, tuple(reach))


def regroup_payload(inertial: InertialRegrouping, label: str, row: int) -> dict[str, Coordinates]:
    """The ten columns of a payload held by link `row`, in terms of those kept.

    The payload is there in the loaded runs only, so what the link's motion shows of it is told apart from the
    robot; a robot of few joints does not show all ten.
    """
    shown = inertial.reach[row].shown
    functionals = (_on_parameters(_full(upper)) for upper in shown.rows.values())
    seen = Span(10, ([f[kind] for kind in PAYLOAD_KEPT_FIRST] for f in functionals))
    names = [f"{kind}{label}" for kind in PAYLOAD_KEPT_FIRST]
    result: dict[str, Coordinates] = {name: {name: 1} for name in names}
    for given_up, relation in seen.annihilator().items():
        result[names[given_up]] = {
            n: -c for n, c in zip(names, relation, strict=True) if c and n != names[given_up]
        }
    return result


def exact_geometry(robot: Robot) -> tuple[Geometry, Exact]:
    """The robot's geometry as exact numbers, and their field."""
    found: list[sp.Expr] = []

    def collect(expression: sp.Expr) -> Number:
        found.append(expression)
        return expression

    symbolic_geometry(robot, collect)
    exact = Exact(found, robot.constants)
    return symbolic_geometry(robot, exact.number), exact


def _link_columns(
    j: int,
    a: int,
    row: Row,
    F: Matrix,
    held: Reach,
    rotor: str | None,
    columns: dict[str, Coordinates],
    exact: Exact,
) -> dict[str, Coordinates]:
    """Columns of link j: those kept, and the others in terms of them and of the columns of link a."""
    kinds = KEPT_FIRST[row.sigma] if rotor else tuple(k for k in KEPT_FIRST[row.sigma] if k != "Iam")
    names = {kind: f"{kind}{rotor if kind == 'Iam' else j}" for kind in kinds}
    shown = Span(len(kinds), ([f[kind] for kind in kinds] for f in _observed(held, row.sigma)))
    result: dict[str, Coordinates] = {name: {name: 1} for name in names.values()}
    for given_up, relation in shown.annihilator().items():
        body = dict.fromkeys(("Iam", *INERTIAL), 0) | dict(zip(kinds, relation, strict=True))
        total: Coordinates = {}
        for kind, coefficient in body.items():
            if coefficient and kind != kinds[given_up]:
                _accumulate(total, {names[kind]: 1}, -coefficient)
        if a:
            for kind, coefficient in _transferred(body, F, row.sigma).items():
                _accumulate(total, columns[f"{kind}{a}"], coefficient)
        result[names[kinds[given_up]]] = {n: c for n, c in total.items() if c}
    return result


def _accumulate(total: Coordinates, column: Coordinates, factor: Number) -> None:
    if not factor:
        return
    for name, coefficient in column.items():
        total[name] = total.get(name, 0) + factor * coefficient


def _observed(held: Reach, sigma: int) -> Iterator[dict[str, Number]]:
    """Functionals on a body of the link (and its rotor) that must vanish for it not to depend on q and dq."""
    if sigma == 2:
        return
    E = _axis(sigma)
    yield _on_parameters(product(transposed(E), E), rotor=1)  # the part in dq^2
    for J in _joint(sigma):
        for V in held.L.rows.values():  # the part in dq
            W = product(_inverse(J), product(_twist(V), J))
            yield _on_parameters(_symmetric(product(transposed(E), W)))
    for upper in (*held.shown.rows.values(), held.weight):  # the part that changes with q
        yield from map(_on_parameters, _changes(_full(upper), sigma))


def _changes(S: Matrix, sigma: int) -> Iterator[Matrix]:
    """J(q)' S J(q) - S at the positions that span it."""
    for J in _joint(sigma)[1:]:
        moved = product(transposed(J), product(S, J))
        yield [[x - y for x, y in zip(u, v, strict=True)] for u, v in zip(moved, S, strict=True)]


def _behind(F: Matrix, a: Reach) -> Reach:
    """The same motion, seen at a frame that F places on the link: F'SF and F^-1 V F."""
    back, Ft = _inverse(F), transposed(F)

    def seen(upper: list[Number]) -> list[Number]:
        return _upper(product(Ft, product(_full(upper), F)))

    shown, L = a.shown, a.L
    if not shown.full:
        shown = Span(10, map(seen, shown.rows.values()))
    if not L.full:
        L = Span(6, (_coordinates(product(back, product(_twist(v), F))) for v in L.rows.values()))
    return Reach(shown, seen(a.weight), L)


def _moved(held: Reach, sigma: int) -> Reach:
    """What the link beyond the joint can do, given what its antecedent can (both seen at the joint's frame)."""
    if sigma == 2:
        return held
    E, joint = _axis(sigma), _joint(sigma)
    velocities = [product(_inverse(J), product(_twist(V), J)) for J in joint for V in held.L.rows.values()]
    L = Span(6, map(_coordinates, [E, *velocities]))
    shown = Span(10, held.shown.rows.values())
    shown.extend([_upper(product(transposed(E), E))])
    shown.extend(_upper(_symmetric(product(transposed(E), W))) for W in velocities)
    for upper in (*held.shown.rows.values(), held.weight):
        shown.extend(map(_upper, _changes(_full(upper), sigma)))
    return Reach(shown, held.weight, L)


def _transferred(body: dict[str, Number], F: Matrix, sigma: int) -> dict[str, Number]:
    """Standard parameters, about the antecedent's frame, of a body averaged over the joint's positions."""
    P = _pseudo_inertia(body)
    if sigma == 0:
        turned = [product(J, product(P, transposed(J))) for J in map(_turn, QUARTER_TURNS)]
        P = [[sum(t[i][k] for t in turned) / QQ(4) for k in range(4)] for i in range(4)]
    P = product(F, product(P, transposed(F)))
    return {
        "XX": P[1][1] + P[2][2],
        "XY": -P[0][1],
        "XZ": -P[0][2],
        "YY": P[0][0] + P[2][2],
        "YZ": -P[1][2],
        "ZZ": P[0][0] + P[1][1],
        "MX": P[0][3],
        "MY": P[1][3],
        "MZ": P[2][3],
        "M": P[3][3],
    }


def _pseudo_inertia(body: dict[str, Number]) -> Matrix:
    """[[S, ms], [ms', M]] with S = tr(I)/2 - I."""
    b = body
    half = (b["XX"] + b["YY"] + b["ZZ"]) / QQ(2)
    return [
        [half - b["XX"], -b["XY"], -b["XZ"], b["MX"]],
        [-b["XY"], half - b["YY"], -b["YZ"], b["MY"]],
        [-b["XZ"], -b["YZ"], half - b["ZZ"], b["MZ"]],
        [b["MX"], b["MY"], b["MZ"], b["M"]],
    ]


def _on_parameters(S: Matrix, rotor: int = 0) -> dict[str, Number]:
    """Coefficients of the functional tr(S P) on the standard parameters, and on the rotor's inertia."""
    half = (S[0][0] + S[1][1] + S[2][2]) / QQ(2)
    return {
        "XX": half - S[0][0],
        "XY": -2 * S[0][1],
        "XZ": -2 * S[0][2],
        "YY": half - S[1][1],
        "YZ": -2 * S[1][2],
        "ZZ": half - S[2][2],
        "MX": 2 * S[0][3],
        "MY": 2 * S[1][3],
        "MZ": 2 * S[2][3],
        "M": S[3][3],
        "Iam": rotor,
    }


def _frame(geometry: Geometry, j: int) -> Matrix:
    """F of row j: T(a(j), j) with the joint variable at zero."""
    zeros = [0] * len(geometry.rows)
    T = transforms(geometry, State([1] * len(zeros), zeros, zeros, zeros, zeros))[j]
    columns = [T.to_antecedent(axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    return [[*(c[i] for c in columns), T.p[i]] for i in range(3)] + [[0, 0, 0, 1]]


def _inverse(T: Matrix) -> Matrix:
    """[[R, p], [0, 1]]^-1 = [[R', -R'p], [0, 1]]."""
    Rt = transposed([row[:3] for row in T[:3]])
    back = product(Rt, [[row[3]] for row in T[:3]])
    return [[*Rt[i], -back[i][0]] for i in range(3)] + [[0, 0, 0, 1]]


def _turn(point: tuple[Number, Number]) -> Matrix:
    c, s = point
    return [[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


def _joint(sigma: int) -> list[Matrix]:
    """J(q) at enough positions to span its effect; the first is the identity."""
    if sigma == 0:
        return [_turn(point) for point in CIRCLE]
    return [[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, q], [0, 0, 0, 1]] for q in LINE]


def _axis(sigma: int) -> Matrix:
    """E = J^-1 dJ/dq."""
    return _twist([0, 0, 1 - sigma, 0, 0, sigma])


def _twist(v: Sequence[Number]) -> Matrix:
    """(w, v) as [[skew(w), v], [0, 0]]."""
    wx, wy, wz, vx, vy, vz = v
    return [[0, -wz, wy, vx], [wz, 0, -wx, vy], [-wy, wx, 0, vz], [0, 0, 0, 0]]


def _coordinates(V: Matrix) -> list[Number]:
    return [V[2][1], V[0][2], V[1][0], V[0][3], V[1][3], V[2][3]]


def _symmetric(A: Matrix) -> Matrix:
    return [[A[i][k] + A[k][i] for k in range(4)] for i in range(4)]


def _upper(S: Matrix) -> list[Number]:
    return [S[i][k] for i in range(4) for k in range(i, 4)]


def _full(upper: Sequence[Number]) -> Matrix:
    u = iter(upper)
    S: Matrix = [[0] * 4 for _ in range(4)]
    for i in range(4):
        for k in range(i, 4):
            S[i][k] = S[k][i] = next(u)
    return S
