"""The torque of one robot with as few operations as we know how: wrenches summed from the tips to the base.

The motion of the links is that of `customized_newton_euler`; the sum is Luh, Walker and Paul's (1980), with

* the wrench of a link whose origin slides along its axis (r_j) taken at the unshifted origin, where that
  saves the link's force;
* second moments along joint axes moved to the antecedent, where that saves more than it costs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from modelgen.geometry.robot import Robot
from modelgen.programs.customized_newton_euler import (
    DEFAULT,
    INERTIAL,
    TENSOR,
    Choices,
    Joint,
    Motion,
    Vector,
    cross,
    forward,
    joints,
    plus,
)
from modelgen.programs.graph import Graph, Scalar, dot

Parameters = dict[tuple[int, str], Scalar]
Moved = tuple[tuple[Joint, ...], list[Motion]]


def moved(robot: Robot, graph: Graph) -> Moved:
    """The joints and the motion of every link on `graph`, for several torques of one robot."""
    rows = joints(robot, graph)
    return rows, forward(robot, graph, rows)


def torque(
    robot: Robot,
    graph: Graph,
    parameters: Mapping[tuple[int, str], Scalar],
    choices: Choices = DEFAULT,
    motion: Moved | None = None,
) -> dict[str, Scalar]:
    """Torque of every moving joint (by its label) for given inertial parameters, {(link, name): scalar}."""
    rows, motions = motion or moved(robot, graph)
    zero = graph.zero
    given = dict(parameters)
    if choices.lines:
        given = _without_lines(robot, graph, rows, given)
    forces: dict[int, Vector] = {}
    moments: dict[int, Vector] = {}
    tau: dict[str, Scalar] = {}
    for joint in reversed(rows):
        j, m = joint.index, motions[joint.index]
        link = {name: given.get((j, name), zero) for name in INERTIAL}
        # a shift would bring moved lines back
        shift = j in choices.shifted and joint.sigma != 1 and not choices.lines
        if shift:
            link = _shifted(link, joint.r)
        vd = m.vd_unshifted if shift else m.vd
        f, n = _wrench(m, link, vd, choices.lines)
        f_children = forces.get(j, (zero, zero, zero))
        n_children = moments.get(j, (zero, zero, zero))
        n = plus(n, n_children)
        if shift:
            n = plus(n, cross((zero, zero, joint.r), f_children))
        f = plus(f, f_children)
        if joint.sigma != 2:
            tau[joint.label] = n[2] if joint.sigma == 0 else f[2]
        if not shift:
            n = plus(n, cross((zero, zero, joint.r), f))
        a = joint.antecedent
        if a:
            f, n = joint.down(f), joint.down(n)
            n = plus(n, cross(joint.p, f))
            forces[a] = plus(forces[a], f) if a in forces else f
            moments[a] = plus(moments[a], n) if a in moments else n
    return {k: tau[k] for k in robot.joint_labels}


def _wrench(m: Motion, link: Mapping[str, Scalar], vd: Vector, lines: bool) -> tuple[Vector, Vector]:
    """Force and moment of a moving link about the point whose acceleration is `vd`."""
    ms = (link["MX"], link["MY"], link["MZ"])
    f = tuple(dot(ms, row) + link["M"] * v for row, v in zip(zip(*m.U), vd))
    (wywz, wxwz, wxwy), (xy, zx, yz) = m.ww, m.differences
    dwx, dwy, dwz = m.dw
    (_, E, minus_D), (minus_F, _, A), (C, minus_B, _) = m.U
    B, D, F = -minus_B, -minus_D, -minus_F
    XX, XY, XZ, YY, YZ, ZZ = (link[name] for name in TENSOR)
    if lines:  # XX and YY are the second moments of y and x, that of z is zero
        n: Vector = (XX * A, YY * D, YY * E + XX * F)
    else:
        n = (
            XX * dwx + (ZZ - YY) * wywz,
            YY * dwy + (XX - ZZ) * wxwz,
            ZZ * dwz + (YY - XX) * wxwy,
        )
    n = plus(n, (XY * D + XZ * E + YZ * yz, XY * A + XZ * zx + YZ * F, XY * xy + XZ * B + YZ * C))
    return f, plus(n, cross(ms, vd))  # type: ignore[return-value]


def _shifted(link: Mapping[str, Scalar], r: Scalar) -> dict[str, Scalar]:
    """The same body about the point that lies r below the origin on z."""
    MX, MY, MZ, M = (link[name] for name in ("MX", "MY", "MZ", "M"))
    more = r * (MZ + MZ + r * M)
    return dict(link) | {
        "XX": link["XX"] + more,
        "YY": link["YY"] + more,
        "XZ": link["XZ"] - r * MX,
        "YZ": link["YZ"] - r * MY,
        "MZ": MZ + r * M,
    }


def _without_lines(robot: Robot, graph: Graph, rows: Sequence[Joint], given: Parameters) -> Parameters:
    """Second moments in place of inertias, with none along z where a joint turns about z.

    A line of mass along a joint's axis moves alike on both sides of that joint, so its second moment
    (XX + YY - ZZ)/2 may be given to the antecedent. What is left has XX = int y^2 dm, YY = int x^2 dm.
    """
    zero, half = graph.zero, graph.scalar(Fraction(1, 2))
    given = dict(given)
    for joint in reversed(rows):
        j = joint.index
        XX, YY, ZZ = (given.get((j, name), zero) for name in ("XX", "YY", "ZZ"))
        line = half * (XX + YY - ZZ)
        given[j, "XX"], given[j, "YY"] = XX - line, YY - line
        a = joint.antecedent
        if not a:
            continue
        z = joint.down((zero, zero, graph.one))
        for k, (u, v) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))):
            delta = (graph.one if u == v else zero) - z[u] * z[v]
            given[a, TENSOR[k]] = given.get((a, TENSOR[k]), zero) + line * delta
    return given
