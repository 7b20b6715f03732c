"""Regrouping of what acts like a body: which combinations no motion can tell apart, exactly.

A body is a symmetric 4 x 4 matrix P (`pseudo_inertia`), and its energies are traces of functionals of its
frame T and velocity V = T^-1 dT/dt:

    kinetic 1/2 tr(V'V P)              potential -1/2 tr(G P),  G = T' (e4 (g, 0)' + (g, 0) e4') T

Seen from its antecedent, T_j = T_a F J(q) with F the constant part of the MDH row and J the joint, a body P
of link j is the body F J P J' F' of link a. A drive adds a rotor, with the kinetic energy Iam dq^2 / 2, and a
constant torque, whose potential is Off q: along a slide that gravity pulls, a weight is a constant force too.
What no torque shows is a set of bodies, rotors and constant torques whose kinetic energies add up to zero and
whose potentials add up to a constant.

**Theorem.** Such sets are the sums of *transfers*: a body P of link j with its drive's Iam and Off, whose
energies together do not depend on q_j and dq_j, for any motion that link a(j) can do, against the same body
held by link a(j).

Proof: in an unobservable set take a link n without descendants. Nothing else depends on q_n and dq_n, so the
energies of its body and drive together cannot either. On a revolute joint they are a trigonometric polynomial
in q_n plus Off q_n: the constant torque is zero, and the rest, constant in q_n, equals its average over q_n,
which is the energy of one body held by a(n). On a prismatic joint they equal their value at q_n = 0, where
Off q_n is zero: the energy of one body held by a(n), again. Put that body there and repeat on the smaller
tree. A body held by the base has no kinetic and a constant potential energy, and is dropped.

So everything is decided link by link, from what a's motion can produce: a space of functionals V'V and G, and
a space of velocities V. Both follow exactly from the antecedent's, because J'SJ is a trigonometric polynomial
of degree 2 in q (five points of the circle span its coefficients) or a polynomial of degree 2 (three points),
and four quarter turns average it exactly. Off q_j goes with G at one state; differences of G between states
are without it. So Iam, M and Off of a slide are tied where the gravity along it never changes, and only
there. (Energies for identifiability: Gautier and Khalil 1990; the spaces and the proof are our own.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import sympy as sp
from sympy.polys.domains import QQ

from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.exact.linear_algebra import Span, product, transposed
from modelgen.exact.numbers import Exact
from modelgen.exact.pseudo_inertia import (
    LINE,
    QUARTER_TURNS,
    Matrix,
    axis,
    constant_frame,
    coordinates,
    full,
    inverse,
    joint_positions,
    on_parameters,
    parameters,
    pseudo_inertia,
    symmetric,
    turn,
    twist,
    upper,
    weight,
)
from modelgen.geometry.kinematics import Geometry, Number, Row, symbolic_geometry
from modelgen.geometry.robot import Robot

Coordinates = dict[str, Number]  # parameter name -> coefficient

# By sigma: which parameters of a link keep their columns where a relation leaves the choice. The paper's
# table keeps XX, ZZ, MX and MY of a revolute link and gives up YY, MZ and M, and Iam rather than ZZ.
KEPT_FIRST = {
    0: ("Offm", "ZZ", "MX", "MY", "XX", "XY", "XZ", "YZ", "Iam", "YY", "MZ", "M"),
    1: ("Offm", "M", "MX", "MY", "MZ", "Iam", "ZZ", "YZ", "YY", "XZ", "XY", "XX"),
    2: INERTIAL,
}
DRIVE = ("Iam", "Offm")
PAYLOAD_KEPT_FIRST = ("M", "MX", "MY", "MZ", "ZZ", "XX", "YY", "XY", "XZ", "YZ")


@dataclass(frozen=True, slots=True)
class InertialRegrouping:
    """Every inertial parameter (and each drive's Iam and Offm) as a combination of those kept.

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

    shown: the span in Sym(4) of its functionals V'V, and of the differences of its G between two states;
    weight: G at one state; L: the span in se(3) of its velocities V. Symmetric matrices by upper triangles.
    """

    shown: Span
    weight: list[Number]
    L: Span


def regroup_inertial(robot: Robot, drives: bool) -> InertialRegrouping:
    """Exact relations among the inertial parameters of `robot`, with each joint's Iam and Offm if `drives`.

    Both act in their own row only (paper eq. 1), as Iam ddq + Offm. Without rotors a constant torque is never
    tied to anything: that takes a rotor that moves as the mass does, but weighs nothing.
    """
    geometry, exact = exact_geometry(robot)
    reach = [Reach(Span(10), upper(weight(geometry.gravity)), Span(6))]  # by row number; 0 is the base
    label = dict(zip(robot.moving, robot.joint_labels, strict=True))
    columns: dict[str, Coordinates] = {}
    for j, row in enumerate(geometry.rows, 1):
        a = row.antecedent + 1
        F = constant_frame(geometry, j - 1)
        held = _behind(F, reach[a])
        drive = label.get(j) if drives else None
        columns.update(_link_columns(j, a, row, F, held, drive, columns))
        reach.append(_moved(held, row.sigma))
    return InertialRegrouping(exact, columns, tuple(reach))


def regroup_payload(inertial: InertialRegrouping, label: str, row: int) -> dict[str, Coordinates]:
    """The ten columns of a payload held by link `row`, in terms of those kept.

    The payload is there in the loaded runs only, so what the link's motion shows of it is told apart from the
    robot; a robot of few joints does not show all ten.
    """
    shown = inertial.reach[row].shown
    functionals = (on_parameters(full(S)) for S in shown.rows.values())
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
    drive: str | None,
    columns: dict[str, Coordinates],
) -> dict[str, Coordinates]:
    """Columns of link j: those kept, and the others in terms of them and of the columns of link a."""
    kinds = tuple(k for k in KEPT_FIRST[row.sigma] if drive or k not in DRIVE)
    names = {kind: f"{kind}{drive if kind in DRIVE else j}" for kind in kinds}
    shown = Span(len(kinds), ([f[kind] for kind in kinds] for f in _observed(held, row.sigma)))
    result: dict[str, Coordinates] = {name: {name: 1} for name in names.values()}
    for given_up, relation in shown.annihilator().items():
        body = dict.fromkeys((*DRIVE, *INERTIAL), 0) | dict(zip(kinds, relation, strict=True))
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
    """Functionals on a body of the link and its drive that must vanish for them to show no q and dq."""
    if sigma == 2:
        return
    E = axis(sigma)
    yield on_parameters(product(transposed(E), E), rotor=1)  # the part in dq^2
    for J in joint_positions(sigma):
        for V in held.L.rows.values():  # the part in dq
            W = product(inverse(J), product(twist(V), J))
            yield on_parameters(symmetric(product(transposed(E), W)))
    for S in held.shown.rows.values():  # the part that changes with q
        yield from map(on_parameters, _changes(full(S), sigma))
    if sigma == 0:
        yield on_parameters([[0] * 4] * 4, offset=1)
        yield from map(on_parameters, _changes(full(held.weight), sigma))
    else:  # -1/2 tr((J'GJ - G) P) + Off q, times -2
        for q, S in zip(LINE[1:], _changes(full(held.weight), sigma), strict=True):
            yield on_parameters(S, offset=-2 * q)


def _changes(S: Matrix, sigma: int) -> Iterator[Matrix]:
    """J(q)' S J(q) - S at the positions that span it."""
    for J in joint_positions(sigma)[1:]:
        moved = product(transposed(J), product(S, J))
        yield [[x - y for x, y in zip(u, v, strict=True)] for u, v in zip(moved, S, strict=True)]


def _behind(F: Matrix, a: Reach) -> Reach:
    """The same motion, seen at a frame that F places on the link: F'SF and F^-1 V F."""
    back, Ft = inverse(F), transposed(F)

    def seen(S: list[Number]) -> list[Number]:
        return upper(product(Ft, product(full(S), F)))

    shown, L = a.shown, a.L
    if not shown.full:
        shown = Span(10, map(seen, shown.rows.values()))
    if not L.full:
        L = Span(6, (coordinates(product(back, product(twist(v), F))) for v in L.rows.values()))
    return Reach(shown, seen(a.weight), L)


def _moved(held: Reach, sigma: int) -> Reach:
    """What the link beyond the joint can do, given what its antecedent can, both at the joint's frame."""
    if sigma == 2:
        return held
    E, positions = axis(sigma), joint_positions(sigma)
    velocities = [product(inverse(J), product(twist(V), J)) for J in positions for V in held.L.rows.values()]
    L = Span(6, map(coordinates, [E, *velocities]))
    shown = Span(10, held.shown.rows.values())
    shown.extend([upper(product(transposed(E), E))])
    shown.extend(upper(symmetric(product(transposed(E), W))) for W in velocities)
    for S in (*held.shown.rows.values(), held.weight):
        shown.extend(map(upper, _changes(full(S), sigma)))
    return Reach(shown, held.weight, L)


def _transferred(body: dict[str, Number], F: Matrix, sigma: int) -> dict[str, Number]:
    """Standard parameters, about the antecedent's frame, of a body averaged over the joint's positions."""
    P = pseudo_inertia(body)
    if sigma == 0:
        turned = [product(J, product(P, transposed(J))) for J in map(turn, QUARTER_TURNS)]
        P = [[sum(t[i][k] for t in turned) / QQ(4) for k in range(4)] for i in range(4)]
    P = product(F, product(P, transposed(F)))
    return parameters(P)
