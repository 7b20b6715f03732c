"""Numeric forward kinematics of an MDH table: Jacobian of the last frame and torques of gravity, for loads.

T(a(j), j) = Rot_z(gamma) Trans_z(b) Rot_x(alpha) Trans_x(d) Rot_z(theta) Trans_z(r)   (Khalil and
Kleinfinger 1986)
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Geometry:
    """Rows of an MDH table as numbers; `joint[j]` is the column of q that moves row j, -1 for a fixed row."""

    sigma: np.ndarray  # (L,) 0 revolute, 1 prismatic, 2 fixed
    antecedent: np.ndarray  # (L,) 0 is the base
    joint: np.ndarray  # (L,)
    table: np.ndarray  # (L, 6) gamma b alpha d theta r
    gravity: np.ndarray  # (3,) m/s^2

    @property
    def n(self) -> int:
        return int((self.joint >= 0).sum())

    def frames(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (L, N, 3, 3) and origins (L, N, 3) of all rows in the base frame; q (N, n) rad | m."""
        N, L = len(q), len(self.sigma)
        R = np.empty((L, N, 3, 3))
        p = np.empty((L, N, 3))
        for j in range(L):
            gamma, b, alpha, d, theta, r = self.table[j]
            a = int(self.antecedent[j]) - 1
            angle = np.full(N, theta)
            shift = np.full(N, r)
            if self.sigma[j] == 0:
                angle = angle + q[:, self.joint[j]]
            elif self.sigma[j] == 1:
                shift = shift + q[:, self.joint[j]]
            cg, sg, ca, sa = np.cos(gamma), np.sin(gamma), np.cos(alpha), np.sin(alpha)
            pre = np.array([[cg, -sg * ca, sg * sa], [sg, cg * ca, -cg * sa], [0.0, sa, ca]])
            ct, st = np.cos(angle), np.sin(angle)
            local = np.empty((N, 3, 3))
            local[:, :, 0] = ct[:, None] * pre[:, 0] + st[:, None] * pre[:, 1]
            local[:, :, 1] = -st[:, None] * pre[:, 0] + ct[:, None] * pre[:, 1]
            local[:, :, 2] = pre[:, 2]
            offset = np.array([d * cg, d * sg, b]) + shift[:, None] * pre[:, 2]
            if a < 0:
                R[j], p[j] = local, offset
            else:
                R[j] = R[a] @ local
                p[j] = p[a] + np.einsum("nij,nj->ni", R[a], offset)
        return R, p

    def ancestors(self, row: int) -> list[int]:
        """Rows on the way from `row` to the base, itself first."""
        way = [row]
        while self.antecedent[way[-1]] > 0:
            way.append(int(self.antecedent[way[-1]]) - 1)
        return way

    def jacobian_torques(self, q: np.ndarray, row: int) -> np.ndarray:
        """(n, N, 6): torque on each joint of a unit wrench (FX FY FZ NX NY NZ, base axes) at the origin of
        `row`."""
        R, p = self.frames(q)
        out = np.zeros((self.n, len(q), 6))
        for j in self.ancestors(row):
            if self.joint[j] < 0:
                continue
            z = R[j, :, :, 2]
            k = self.joint[j]
            if self.sigma[j] == 0:
                out[k, :, :3] = np.cross(z, p[row] - p[j])
                out[k, :, 3:] = z
            else:
                out[k, :, :3] = z
        return out

    def gravity_torques(self, q: np.ndarray, moments: dict[int, np.ndarray], g: np.ndarray) -> np.ndarray:
        """(n, N): drive torque that holds bodies against gravity g; `moments[row]` is (MX, MY, MZ, M) of
        the row."""
        R, p = self.frames(q)
        out = np.zeros((self.n, len(q)))
        for row, body in moments.items():
            ms = np.einsum("nij,j->ni", R[row], body[:3])
            for j in self.ancestors(row):
                if self.joint[j] < 0:
                    continue
                z = R[j, :, :, 2]
                k = self.joint[j]
                if self.sigma[j] == 0:
                    arm = ms + body[3] * (p[row] - p[j])
                    out[k] -= np.einsum("ni,ni->n", z, np.cross(arm, g))
                else:
                    out[k] -= body[3] * (z @ g)
        return out


def geometry_of(robot) -> Geometry:
    """Numbers of a modelgen robot value."""
    order = {row: k for k, row in enumerate(robot.moving)}
    rows = range(1, len(robot.links) + 1)

    def number(expression) -> float:
        return float(robot.value(expression))

    table = [
        [number(x) for x in (link.gamma, link.b, link.alpha, link.d, link.theta, link.r)]
        for link in robot.links
    ]
    return Geometry(
        np.array([link.sigma for link in robot.links]),
        np.array([link.antecedent for link in robot.links]),
        np.array([order.get(row, -1) for row in rows]),
        np.array(table),
        np.array([number(g) for g in robot.gravity]),
    )
