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
    # samples side by side in memory, as they are read
    R, p = np.empty((L, 3, 3, N)), np.empty((L, 3, N))
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
        fixed = _rz(gamma) @ _rx(alpha)  # (3, 3)
        shift = (np.array([0.0, 0.0, b]) + fixed @ np.array([d, 0.0, 0.0]))[:, None] + r * fixed[:, 2:]
        if link.antecedent == 0:
            axes, p[row] = np.broadcast_to(fixed[:, :, None], (3, 3, N)), shift
        else:
            a = link.antecedent - 1
            axes = fixed.T @ R[a]
            p[row] = p[a] + np.einsum("ijn,jn->in", R[a], shift)
        c, s = np.cos(theta), np.sin(theta)
        R[row, :, 0] = c * axes[:, 0] + s * axes[:, 1]
        R[row, :, 1] = c * axes[:, 1] - s * axes[:, 0]
        R[row, :, 2] = axes[:, 2]
    return Frames(
        R=R.transpose(3, 0, 1, 2),
        p=p.transpose(2, 0, 1),
        sigma=tuple(link.sigma for link in robot.links),
        antecedent=tuple(link.antecedent for link in robot.links),
        joint=tuple(joint),
    )


def _rz(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _rx(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
