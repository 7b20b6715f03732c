"""The joint that stands on the base: another zero of it and another mounting of the base are one thing.

What a first joint turns is seen from the base by gravity alone, so that q1 + x with gravity g is q1 with g
turned by -x about the joint's axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.examination.fits.sphere import degrees_between
from modelgen.geometry.kinematics import Geometry, State, Vector, transforms

ROBOT_FILE = "the robot file"
ROUND_ANGLE = 4.0  # degrees, within which an axis of the base is meant


@dataclass(frozen=True, slots=True)
class FirstAxis:
    """name: of the joint's position in a study; axis (3,) in the base's frame."""

    name: str
    axis: np.ndarray

    @classmethod
    def of(cls, table: Geometry, joints: Sequence[object]) -> FirstAxis | None:
        """joints: labels of the moving ones. None where several bodies stand on the base, or one slides."""
        first = [k for k, row in enumerate(table.rows) if row.antecedent == -1]
        if len(first) != 1 or table.rows[first[0]].sigma != 0:
            return None
        one, zero = (1,) * len(table.moving), (0,) * len(table.moving)
        frame = transforms(table, State(one, zero, zero, zero, zero))[first[0]]
        return cls(
            f"q{joints[table.moving.index(first[0])]}", np.array(frame.to_antecedent((0, 0, 1)), float)
        )

    def turned(self, gravity: Vector | np.ndarray, zero: float) -> np.ndarray:
        """Gravity (3,) that is the same as `zero` rad added to the joint's position; an axis of the base
        where it is close to one."""
        g = self._about(np.array(gravity, float), zero)
        axes = np.linalg.norm(g) * np.vstack([np.eye(3), -np.eye(3)])
        near = axes[np.argmax(axes @ g)]
        return near if degrees_between(near, g) < ROUND_ANGLE else g

    def _about(self, g: np.ndarray, zero: float) -> np.ndarray:
        along = self.axis * (self.axis @ g)
        return np.asarray(along + np.cos(zero) * (g - along) - np.sin(zero) * np.cross(self.axis, g))

    def zero_of(self, assumed: np.ndarray, gravity: np.ndarray, within: float) -> str:
        """In words what else gravity's direction may be, known to so many degrees; nothing where no zero of
        the joint makes it of what is assumed."""
        a, b = (g - self.axis * (self.axis @ g) for g in (assumed, gravity))
        zero = float(np.arctan2(-self.axis @ np.cross(a, b), a @ b))
        far = degrees_between(self._about(assumed, zero), gravity)
        return (
            f", or {self.name} starts from another zero, about {-zero:.2g} rad off" if far <= within else ""
        )


def told_by(gravity: object) -> str:
    """The file that says where gravity is, by the study's own, if it has one. (Of a study that turned it over
    it was told to be turned against the robot file's, which was right.)"""
    return ROBOT_FILE if gravity is None else "the study"


def gravity_line(gravity: np.ndarray) -> str:
    """The study's line."""
    size = np.linalg.norm(gravity)
    return f"gravity: [{', '.join(f'{x:.3g}' if abs(x) > 0.005 * size else '0' for x in gravity)}]"
