"""The four identification models of the paper (eqs. 1 to 5): torques are rows, parameters are columns.

    A  tau_m         = Iam ddq + M ddq + H + tau_fm + tau_fl     motor torques            (1)
    B  tau_l         =           M ddq + H          + tau_fl     joint torque sensors     (2)
    C  tau_m, tau_l                                              both                     (1), (2)
    D  tau_m - tau_l = Iam ddq             + tau_fm              their difference         (3)

with tau_f = Fv dq + Fc sign(dq) + Off on either side (4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from modelgen.dynamics.newton_euler import INERTIAL, Namer, regressor, unnamed
from modelgen.dynamics.standard_parameters import (
    LINK_SIDE,
    MOTOR_SIDE,
    StandardParameter,
    standard_parameters,
)
from modelgen.errors import ModelgenError
from modelgen.geometry.kinematics import Geometry, Number, State
from modelgen.geometry.robot import Robot


@dataclass(frozen=True, slots=True)
class Model:
    """One model: a row family per measured torque, with the sides of the drive that act in it."""

    name: str
    families: tuple[tuple[str, tuple[str, ...]], ...]  # (channel prefix, parameter kinds seen by its rows)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Every parameter kind of the model."""
        return tuple(dict.fromkeys(kind for _, kinds in self.families for kind in kinds))

    def channels(self, robot: Robot) -> tuple[str, ...]:
        """Names of the rows: ("tau_m1", ..., "tau_m7"); model C: motor rows, then sensor rows."""
        return tuple(prefix + k for prefix, _ in self.families for k in robot.joint_labels)

    def standard_parameters(self, robot: Robot, payload: str | None = None) -> tuple[StandardParameter, ...]:
        """Columns before regrouping."""
        return standard_parameters(robot, self.kinds, payload)


_MOTOR = ("tau_m", (*MOTOR_SIDE, *INERTIAL, *LINK_SIDE))
_SENSOR = ("tau_l", (*INERTIAL, *LINK_SIDE))
MODELS = {
    "A": Model("A", (_MOTOR,)),
    "B": Model("B", (_SENSOR,)),
    "C": Model("C", (_MOTOR, _SENSOR)),
    "D": Model("D", (("tau_d", MOTOR_SIDE),)),
}


def model(name: str) -> Model:
    """The model called `name`; raises ModelgenError otherwise."""
    if name not in MODELS:
        raise ModelgenError(f"there is no model {name!r}; choose A, B, C or D")
    return MODELS[name]


def standard_regressor(
    robot: Robot,
    geometry: Geometry,
    model: Model,
    state: State,
    sign: Sequence[Number],
    columns: Sequence[StandardParameter],
    name: Namer = unnamed,
) -> dict[str, tuple[Number, ...]]:
    """W_st by columns: parameter name -> one number per channel (the integer 0 where it cannot act).

    `sign` replaces sign(dq), one number per moving joint.
    """
    index = {j: i for i, j in enumerate(robot.moving)}
    wanted = dict.fromkeys((p.row, p.kind) for p in columns if p.kind in INERTIAL)
    inertial = regressor(geometry, state, wanted, name) if wanted else {}
    signal = {"Iam": state.ddq, "Fvm": state.dq, "Fvl": state.dq, "Fcm": sign, "Fcl": sign}
    result = {}
    for p in columns:
        entries: list[Number] = []
        for _, kinds in model.families:
            if p.kind not in kinds:
                entries += [0] * robot.n
            elif p.kind in INERTIAL:
                entries += inertial[p.row, p.kind]
            else:
                i = index[p.row]
                value = signal[p.kind][i] if p.kind in signal else 1
                entries += [value if k == i else 0 for k in range(robot.n)]
        result[p.name] = tuple(entries)
    return result
