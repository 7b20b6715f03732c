"""Where the links are, as numbers over a whole record: what contacts and tilted gravity need.

A second, simple implementation of the kinematics, vectorised over samples. Base axes, SI units.
"""

from dataclasses import dataclass

import numpy as np

from modelgen.geometry.robot import Robot

Array = np.ndarray


@dataclass(frozen=True)
class Frames:
    """Frames of all rows of the robot file over N samples. `joint[j]`: column of q, -1 for a fixed row."""

    R: Array  # (N, L, 3, 3) axes of frame j in base axes
    p: Array  # (N, L, 3) origin of frame j, m
    sigma: tuple[int, ...]
    antecedent: tuple[int, ...]  # 0 is the base
    joint: tuple[int, ...]

    @property
    def n(self) -> int:
        return sum(j >= 0 for j in self.joint)

    def above(self, row: int) -> list[int]:
        """Rows (0-based) from `row` down to the base, itself included: the joints that move link `row`."""
        chain = []
        while row >= 0:
            chain.append(row)
            row = self.antecedent[row] - 1
        return chain


def frames(robot: Robot, q: Array) -> Frames:
    """Evaluate T(a(j), j) = Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Tz(r) for every row; q (N, n)."""
    q = np.asarray(q, dtype=float)
    N, L = len(q), len(robot.links)
    R, p = np.empty((N, L, 3, 3)), np.empty((N, L, 3))
    joint: list[int] = []
    for row, link in enumerate(robot.links):
        moving = link.sigma != 2
        joint.append(sum(j >= 0 for j in joint) if moving else -1)
        variable = q[:, joint[row]] if moving else np.zeros(N)
        gamma, b, alpha, d, theta0, r0 = (
            float(robot.value(getattr(link, name))) for name in ("gamma", "b", "alpha", "d", "theta", "r")
        )
        theta = theta0 + variable * (link.sigma == 0)
        r = r0 + variable * (link.sigma == 1)
        fixed = _rz(np.array([gamma])) @ _rx(alpha)  # (1, 3, 3)
        turn = fixed @ _rz(theta)
        shift = np.array([0.0, 0.0, b]) + fixed[0] @ np.array([d, 0.0, 0.0]) + r[:, None] * fixed[0][:, 2]
        if link.antecedent == 0:
            R[:, row], p[:, row] = turn, shift
        else:
            a = link.antecedent - 1
            R[:, row] = R[:, a] @ turn
            p[:, row] = p[:, a] + np.einsum("nij,nj->ni", R[:, a], shift)
    return Frames(
        R=R,
        p=p,
        sigma=tuple(link.sigma for link in robot.links),
        antecedent=tuple(link.antecedent for link in robot.links),
        joint=tuple(joint),
    )


def _rz(angle: Array) -> Array:
    c, s, o, i = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([c, -s, o, s, c, o, o, o, i], axis=-1).reshape(*angle.shape, 3, 3)


def _rx(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
