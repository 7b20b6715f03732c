"""The standard parameters of a robot (paper eq. 6): their names, order and units."""

from __future__ import annotations

from dataclasses import dataclass

from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.geometry.robot import Robot

MOTOR_SIDE = ("Iam", "Fvm", "Fcm", "Offm")
LINK_SIDE = ("Fvl", "Fcl", "Offl")


@dataclass(frozen=True, slots=True)
class StandardParameter:
    """One standard parameter: ZZ of row 2 is ZZ2, Fvm of joint variable q2 is Fvm2, M of payload L is ML."""

    kind: str
    label: str  # row number, number of the joint variable, or payload label
    row: int  # MDH row of the body or joint
    sigma: int  # of that row
    payload: bool = False

    @property
    def name(self) -> str:
        """The paper's name."""
        return self.kind + self.label

    @property
    def unit(self) -> str:
        """SI unit, joint side."""
        if self.kind in INERTIAL:
            return {"M": "kg"}.get(self.kind, "kg m" if self.kind.startswith("M") else "kg m^2")
        linear = self.sigma == 1
        match self.kind:
            case "Iam":
                return "kg" if linear else "kg m^2"
            case "Fvm" | "Fvl":
                return "N s/m" if linear else "N m s/rad"
            case _:
                return "N" if linear else "N m"


def standard_parameters(
    robot: Robot, kinds: tuple[str, ...] = (*MOTOR_SIDE, *INERTIAL, *LINK_SIDE), payload: str | None = None
) -> tuple[StandardParameter, ...]:
    """Parameters of the given kinds, row by row in the order of paper eq. (6), the payload's ten last."""
    label = dict(zip(robot.moving, robot.joint_labels, strict=True))
    result = []
    for j, link in enumerate(robot.links, 1):
        for kind in (*MOTOR_SIDE, *INERTIAL, *LINK_SIDE):
            if kind in kinds and (kind in INERTIAL or j in label):
                result.append(
                    StandardParameter(kind, str(j) if kind in INERTIAL else label[j], j, link.sigma)
                )
    if payload is not None and set(INERTIAL) <= set(kinds):
        row = robot.payload_link(payload)
        result += [StandardParameter(kind, payload, row, robot.link(row).sigma, True) for kind in INERTIAL]
    return tuple(result)
