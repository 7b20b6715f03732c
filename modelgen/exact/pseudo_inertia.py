"""Bodies, frames and velocities as 4 x 4 matrices, for `regrouping`; the number type is open.

The pseudo-inertia of a body is P = [[S, ms], [ms', M]] with S = tr(I)/2 - I its second moments, ms its first
and M its mass (Wensing, Kim and Slotine 2018, sec. III). Seen from where its frame is T, it is T P T'.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sympy.polys.domains import QQ

from modelgen.exact.linear_algebra import product, transposed
from modelgen.geometry.kinematics import Geometry, Number, State, Vector, transforms

Matrix = list[list[Number]]

QUARTER_TURNS = ((1, 0), (0, 1), (-1, 0), (0, -1))
CIRCLE = (*QUARTER_TURNS, (QQ(3, 5), QQ(4, 5)))
LINE = (0, 1, -1)


def pseudo_inertia(body: Mapping[str, Number]) -> Matrix:
    """[[S, ms], [ms', M]] with S = tr(I)/2 - I."""
    b = body
    half = (b["XX"] + b["YY"] + b["ZZ"]) / QQ(2)
    return [
        [half - b["XX"], -b["XY"], -b["XZ"], b["MX"]],
        [-b["XY"], half - b["YY"], -b["YZ"], b["MY"]],
        [-b["XZ"], -b["YZ"], half - b["ZZ"], b["MZ"]],
        [b["MX"], b["MY"], b["MZ"], b["M"]],
    ]


def parameters(P: Matrix) -> dict[str, Number]:
    """Standard parameters of a pseudo-inertia."""
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


def on_parameters(S: Matrix, rotor: int = 0, offset: int = 0) -> dict[str, Number]:
    """Coefficients of the functional tr(S P) + rotor Iam + offset Offm on the standard parameters."""
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
        "Offm": offset,
    }


def weight(gravity: Vector) -> Matrix:
    """e4 (g, 0)' + (g, 0) e4': a body P in the base frame has the potential energy -1/2 tr(this P)."""
    x, y, z = gravity
    return [[0, 0, 0, x], [0, 0, 0, y], [0, 0, 0, z], [x, y, z, 0]]


def constant_frame(geometry: Geometry, j: int) -> Matrix:
    """F of row j: T(a(j), j) with the joint variable at zero."""
    zeros = [0] * len(geometry.rows)
    T = transforms(geometry, State([1] * len(zeros), zeros, zeros, zeros, zeros))[j]
    columns = [T.to_antecedent(axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    return [[*(c[i] for c in columns), T.p[i]] for i in range(3)] + [[0, 0, 0, 1]]


def inverse(T: Matrix) -> Matrix:
    """[[R, p], [0, 1]]^-1 = [[R', -R'p], [0, 1]]."""
    Rt = transposed([row[:3] for row in T[:3]])
    back = product(Rt, [[row[3]] for row in T[:3]])
    return [[*Rt[i], -back[i][0]] for i in range(3)] + [[0, 0, 0, 1]]


def turn(point: tuple[Number, Number]) -> Matrix:
    """Rot_z of the angle with this (cos, sin)."""
    c, s = point
    return [[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


def joint_positions(sigma: int) -> list[Matrix]:
    """J(q) at enough positions to span its effect; the first is the identity."""
    if sigma == 0:
        return [turn(point) for point in CIRCLE]
    return [[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, q], [0, 0, 0, 1]] for q in LINE]


def axis(sigma: int) -> Matrix:
    """E = J^-1 dJ/dq."""
    return twist([0, 0, 1 - sigma, 0, 0, sigma])


def twist(v: Sequence[Number]) -> Matrix:
    """(w, v) as [[skew(w), v], [0, 0]]."""
    wx, wy, wz, vx, vy, vz = v
    return [[0, -wz, wy, vx], [wz, 0, -wx, vy], [-wy, wx, 0, vz], [0, 0, 0, 0]]


def coordinates(V: Matrix) -> list[Number]:
    """(w, v) of such a matrix."""
    return [V[2][1], V[0][2], V[1][0], V[0][3], V[1][3], V[2][3]]


def symmetric(A: Matrix) -> Matrix:
    """A + A'."""
    return [[A[i][k] + A[k][i] for k in range(4)] for i in range(4)]


def upper(S: Matrix) -> list[Number]:
    """The ten entries of a symmetric matrix's upper triangle."""
    return [S[i][k] for i in range(4) for k in range(i, 4)]


def full(triangle: Sequence[Number]) -> Matrix:
    """The symmetric matrix of an upper triangle."""
    u = iter(triangle)
    S: Matrix = [[0] * 4 for _ in range(4)]
    for i in range(4):
        for k in range(i, 4):
            S[i][k] = S[k][i] = next(u)
    return S
