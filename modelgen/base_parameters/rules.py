"""Regrouping rules of a model: its base parameters, each a combination of standard parameters.

Inertial parameters, rotors and constant torques are regrouped in `regrouping`; what is left is plain. Where
both sides of a drive act in the same rows (model A), link-side friction joins the motor side's (Fvm1R =
Fvm1 + Fvl1); where the sensor separates them (C), Iam and Offm stay apart from the links too. A payload
moves with its link, but only in the loaded runs, so its ten parameters stand beside the robot's own; a robot
of few joints shows fewer than ten of them, and then the payload's are regrouped among themselves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from modelgen.base_parameters.regrouping import Coordinates, regroup_inertial, regroup_payload
from modelgen.dynamics.models import Model, model
from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.dynamics.standard_parameters import StandardParameter
from modelgen.exact.numbers import Exact
from modelgen.geometry.labels import check_payload_label
from modelgen.geometry.robot import Robot

SAME_SIGNAL = {"Fvl": "Fvm", "Fcl": "Fcm", "Offl": "Offm"}


@dataclass(frozen=True, slots=True)
class BaseParameter:
    """One base parameter: a sum of coefficient x standard parameter, the kept one first, with 1."""

    keeps: StandardParameter
    combination: Mapping[str, sp.Expr]

    @property
    def name(self) -> str:
        """The kept parameter's name, with R if others were regrouped into it."""
        return self.keeps.name + ("R" if len(self.combination) > 1 else "")


@dataclass(frozen=True)
class Rules:
    """The regrouping of one model: W_st chi_st = W chi for every motion, with chi from `base`.

    columns[name] says which combination of kept columns the column of a standard parameter is.
    """

    robot: Robot
    model: Model
    payload: str | None
    standard: tuple[StandardParameter, ...]
    base: tuple[BaseParameter, ...]
    columns: Mapping[str, Mapping[str, sp.Expr]]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the base parameters, in order."""
        return tuple(b.name for b in self.base)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the rows."""
        return self.model.channels(self.robot)

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Standard parameters that act in no torque, alone or with others."""
        return tuple(p.name for p in self.standard if not self.columns[p.name])


def derive_rules(robot: Robot, model_name: str, payload: str | None = None) -> Rules:
    """Derive the base parameters of a model of `robot`, exactly, with a payload's columns if one is named.

    Order: the links' inertial parameters, then each joint's drive, then the payload's.
    """
    chosen = model(model_name)
    if payload is not None:
        check_payload_label(payload)
    standard = chosen.standard_parameters(robot, payload)
    drives_regroup = len(chosen.families) == 1 and "Iam" in chosen.kinds
    inertial = regroup_inertial(robot, drives_regroup) if "M" in chosen.kinds else None
    columns: dict[str, Coordinates] = dict(inertial.columns) if inertial else {}
    for p in standard:
        if p.kind not in INERTIAL and p.name not in columns:
            partner = SAME_SIGNAL.get(p.kind)
            shared = partner in chosen.kinds and len(chosen.families) == 1
            name = f"{partner}{p.label}" if shared else p.name
            columns[p.name] = {name: 1}
    if payload is not None and inertial is not None:
        columns.update(regroup_payload(inertial, payload, robot.payload_link(payload)))
    return _assemble(robot, chosen, payload, standard, columns, inertial.exact if inertial else Exact((), {}))


def derive_all(robot: Robot, payload: str | None = None) -> dict[str, Rules]:
    """Rules of the four models."""
    return {name: derive_rules(robot, name, payload) for name in "ABCD"}


def declared_payload(robot: Robot) -> str | None:
    """The payload that the robot file declares (the first, if several): counts include it."""
    return next(iter(robot.payloads), None)


def _assemble(
    robot: Robot,
    chosen: Model,
    payload: str | None,
    standard: tuple[StandardParameter, ...],
    columns: dict[str, Coordinates],
    exact: Exact,
) -> Rules:
    def group(p: StandardParameter) -> int:
        return 2 if p.payload else 0 if p.kind in INERTIAL else 1

    named = {p.name: {n: exact.expression(c) for n, c in columns[p.name].items()} for p in standard}
    kept = sorted((p for p in standard if named[p.name] == {p.name: 1}), key=group)
    base = []
    for p in kept:
        others = {s.name: named[s.name][p.name] for s in standard if s is not p and p.name in named[s.name]}
        base.append(BaseParameter(p, {p.name: sp.Integer(1), **others}))
    return Rules(robot, chosen, payload, standard, tuple(base), named)
