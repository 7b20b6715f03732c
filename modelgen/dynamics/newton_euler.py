"""Newton-Euler in MDH frames, once, for every number type: torque of given parameters, and the regressor.

Outward, with z the joint axis, w and dw the rotational velocity and acceleration, dv the linear acceleration
of the frame's origin minus gravity (Khalil and Dombre 2002, ch. 9; Luh, Walker and Paul 1980):

    w_j  = R w_a + z dq                     dw_j = R dw_a + (R w_a x z) dq + z ddq      (z terms: revolute)
    dv_j = R (dv_a + U_a p) + 2 (R w_a x z) dq + z ddq                                  (z terms: prismatic)
    U_j  = skew(dw_j) + skew(w_j)^2

The wrench that moves body j (inertia I about the frame's origin, first moments ms, mass M) is linear in them:

    f = M dv + U ms          n = I dw + w x (I w) + ms x dv

and inward it adds up to tau_j, the z component of n (revolute) or of f (prismatic). Inertia matrix, first
moments and mass are the standard parameters XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M (paper eq. 6).

`name(label, value)` is called on every intermediate and may return a fresh symbol for it, as SYMORO does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.geometry.kinematics import (
    NULL,
    Geometry,
    Number,
    State,
    Transform,
    Vector,
    add,
    apply,
    cross,
    mul,
    plus,
    sub,
    transforms,
)

INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")

Namer = Callable[[str, Number], Number]
Column = tuple[int, str]  # (row from 1, one of INERTIAL)


def unnamed(label: str, value: Number) -> Number:
    """Leave an intermediate as it is."""
    return value


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion of one frame, in its own axes: w, dw, dv and U = skew(dw) + skew(w)^2 (three rows)."""

    w: Vector
    dw: Vector
    dv: Vector
    U: tuple[Vector, Vector, Vector]
    ww: tuple[
        Number, Number, Number, Number, Number, Number
    ]  # w_x w_x, w_x w_y, w_x w_z, w_y w_y, w_y w_z, w_z w_z


def motions(geometry: Geometry, state: State, name: Namer = unnamed) -> tuple[tuple[Transform, Motion], ...]:
    """Outward recursion: the transform and the motion of every row."""
    index = {j: i for i, j in enumerate(geometry.moving)}
    gx, gy, gz = geometry.gravity
    base = Motion(NULL, NULL, (sub(0, gx), sub(0, gy), sub(0, gz)), (NULL, NULL, NULL), (0,) * 6)
    result: list[tuple[Transform, Motion]] = []
    for j, T in enumerate(transforms(geometry, state)):
        a = result[T.row.antecedent][1] if T.row.antecedent >= 0 else base
        w, dw = T.to_link(a.w), T.to_link(a.dw)
        dv = T.to_link(plus(a.dv, apply(a.U, T.p)))
        if T.row.sigma != 2:
            dq, ddq = state.dq[index[j]], state.ddq[index[j]]
            if T.row.sigma == 0:
                dw = (add(dw[0], mul(w[1], dq)), sub(dw[1], mul(w[0], dq)), add(dw[2], ddq))
                w = (w[0], w[1], add(w[2], dq))
            else:
                twice = mul(2, dq)
                dv = (add(dv[0], mul(w[1], twice)), sub(dv[1], mul(w[0], twice)), add(dv[2], ddq))
        w, dw, dv = (_named(name, k, j, v) for k, v in (("W", w), ("DW", dw), ("DV", dv)))
        result.append((T, _motion(w, dw, dv, j, name)))
    return tuple(result)


def _motion(w: Vector, dw: Vector, dv: Vector, j: int, name: Namer) -> Motion:
    xx, xy, xz, yy, yz, zz = ww = tuple(
        name(f"W{'xyz'[i]}W{'xyz'[k]}{j + 1}", mul(w[i], w[k])) for i in range(3) for k in range(i, 3)
    )
    U = (
        (sub(0, add(yy, zz)), sub(xy, dw[2]), add(xz, dw[1])),
        (add(xy, dw[2]), sub(0, add(xx, zz)), sub(yz, dw[0])),
        (sub(xz, dw[1]), add(yz, dw[0]), sub(0, add(xx, yy))),
    )
    return Motion(w, dw, dv, tuple(_named(name, f"U{i + 1}", j, row) for i, row in enumerate(U)), ww)  # type: ignore[arg-type]


def _named(name: Namer, label: str, j: int, v: Vector) -> Vector:
    x, y, z = (name(f"{label}{axis}{j + 1}", component) for axis, component in zip("xyz", v, strict=True))
    return x, y, z


def unit_wrench(kind: str, m: Motion) -> tuple[Vector, Vector]:
    """Force and moment, in the body's frame, of a body whose parameter `kind` is 1 and whose others are 0."""
    (dwx, dwy, dwz), (vx, vy, vz), U = m.dw, m.dv, m.U
    xx, xy, xz, yy, yz, zz = m.ww
    match kind:
        case "XX":
            return NULL, (dwx, xz, sub(0, xy))
        case "XY":
            return NULL, (sub(dwy, xz), add(dwx, yz), sub(xx, yy))
        case "XZ":
            return NULL, (add(dwz, xy), sub(zz, xx), sub(dwx, yz))
        case "YY":
            return NULL, (sub(0, yz), dwy, xy)
        case "YZ":
            return NULL, (sub(yy, zz), sub(dwz, xy), add(dwy, xz))
        case "ZZ":
            return NULL, (yz, sub(0, xz), dwz)
        case "MX":
            return (U[0][0], U[1][0], U[2][0]), (0, sub(0, vz), vy)
        case "MY":
            return (U[0][1], U[1][1], U[2][1]), (vz, 0, sub(0, vx))
        case "MZ":
            return (U[0][2], U[1][2], U[2][2]), (sub(0, vy), vx, 0)
        case "M":
            return m.dv, NULL
    raise AssertionError(kind)


def _to_antecedent(T: Transform, f: Vector, n: Vector) -> tuple[Vector, Vector]:
    force = T.to_antecedent(f)
    return force, plus(T.to_antecedent(n), cross(T.p, force))


def _inward(
    frames: Sequence[tuple[Transform, Motion]],
    row: int,
    f: Vector,
    n: Vector,
    named: Callable[[int, Vector, Vector], tuple[Vector, Vector]] = lambda a, f, n: (f, n),
) -> Iterator[tuple[int, Number]]:
    """Of a wrench on the body of a row what each joint from there to the base feels along its axis."""
    j = row
    while j >= 0:
        T, a = frames[j][0], frames[j][0].row.antecedent
        if T.row.sigma != 2:
            yield j, n[2] if T.row.sigma == 0 else f[2]
        if a >= 0:
            f, n = named(a, *_to_antecedent(T, f, n))
        j = a


def regressor(
    geometry: Geometry, state: State, columns: Iterable[Column], name: Namer = unnamed
) -> dict[Column, tuple[Number, ...]]:
    """Columns of the inertial regressor: (row, kind) -> n torques of that parameter being 1.

    A torque that no motion can produce is the integer 0. A payload's columns are its link's columns.
    """
    frames = motions(geometry, state, name)
    index = {j: i for i, j in enumerate(geometry.moving)}
    result = {}
    for row, kind in columns:
        tau: list[Number] = [0] * len(index)

        def named(a: int, f: Vector, n: Vector, label: str = f"{kind}{row}_") -> tuple[Vector, Vector]:
            return _named(name, f"F{label}", a, f), _named(name, f"N{label}", a, n)

        for j, felt in _inward(frames, row - 1, *unit_wrench(kind, frames[row - 1][1]), named):
            tau[index[j]] = name(f"{kind}{row}_{j + 1}", felt)
        result[row, kind] = tuple(tau)
    return result


def regressor_of_samples(geometry: Geometry, state: State, samples: int) -> np.ndarray:
    """(n, 10 L, N): the same of all bodies' parameters for a state of arrays (N,); those of a body are taken
    inward together."""
    frames = motions(geometry, state)
    index = {j: i for i, j in enumerate(geometry.moving)}
    out = np.zeros((len(index), 10 * len(frames), samples))
    for row, (_, m) in enumerate(frames):
        wrenches = {k: wrench for k, kind in enumerate(INERTIAL) if _felt(wrench := unit_wrench(kind, m))}
        if not wrenches:
            continue
        f, n = (_stacked([w[part] for w in wrenches.values()], samples) for part in (0, 1))
        columns = [10 * row + k for k in wrenches]
        for j, felt in _inward(frames, row, f, n):
            out[index[j], columns] = felt
    return out


def _felt(wrench: tuple[Vector, Vector]) -> bool:
    return any(isinstance(x, np.ndarray) or x != 0 for vector in wrench for x in vector)


def _stacked(vectors: list[Vector], samples: int) -> Vector:
    """A vector whose components are arrays (vectors, N)."""
    x, y, z = np.zeros((3, len(vectors), samples))
    for k, vector in enumerate(vectors):
        for component, value in zip((x, y, z), vector):
            if isinstance(value, np.ndarray) or value:
                component[k] = value
    return x, y, z


def torque(
    geometry: Geometry, state: State, parameters: Mapping[Column, Number], name: Namer = unnamed
) -> tuple[Number, ...]:
    """Inverse dynamics M(q) ddq + H(q, dq) of the given inertial parameters; missing ones are zero."""
    frames = motions(geometry, state, name)
    index = {j: i for i, j in enumerate(geometry.moving)}
    forces: list[Vector] = []
    moments: list[Vector] = []
    for j, (_, m) in enumerate(frames):
        XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = (parameters.get((j + 1, kind), 0) for kind in INERTIAL)
        ms = (MX, MY, MZ)
        inertia = ((XX, XY, XZ), (XY, YY, YZ), (XZ, YZ, ZZ))
        f = plus(apply(m.U, ms), (mul(M, m.dv[0]), mul(M, m.dv[1]), mul(M, m.dv[2])))
        momentum = _named(name, "H", j, apply(inertia, m.w))
        n = plus(plus(apply(inertia, m.dw), cross(m.w, momentum)), cross(ms, m.dv))
        forces.append(_named(name, "F", j, f))
        moments.append(_named(name, "N", j, n))
    tau: list[Number] = [0] * len(index)
    for j in range(len(frames) - 1, -1, -1):
        T, a = frames[j][0], frames[j][0].row.antecedent
        if T.row.sigma != 2:
            tau[index[j]] = name(f"tau{j + 1}", moments[j][2] if T.row.sigma == 0 else forces[j][2])
        if a >= 0:
            f, n = _to_antecedent(T, forces[j], moments[j])
            forces[a] = _named(name, f"F{j + 1}_", a, plus(forces[a], f))
            moments[a] = _named(name, f"N{j + 1}_", a, plus(moments[a], n))
    return tuple(tau)
