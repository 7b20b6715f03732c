"""One model of one robot, ready to be emitted: its description as plain data, and its programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import sympy as sp

from modelgen.base_parameters.rules import Rules, derive_rules
from modelgen.base_parameters.rules_text import regroups
from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.emit.effect_columns import effect_columns
from modelgen.geometry.kinematics import geometry
from modelgen.geometry.robot import Limits, Robot
from modelgen.programs.cheapest import SIGNALS, Columns, columns_program, torque_program
from modelgen.programs.graph import Operations, Program

CHEAP_SUM = 3  # terms; a column of its own costs five operations a row and more
FORMAT = 2  # of the description; a cache entry of another format is rebuilt


@dataclass(frozen=True, slots=True)
class Derived:
    """`description` is what `generated` reads with the C; `derive` tells the programs' inputs and outputs."""

    description: dict[str, Any]
    columns: Program
    terms: tuple[sp.Expr, ...]  # of effects, behind the outputs of `columns`
    torque: Program


def derive(robot: Robot, model_name: str, payload: str | None = None, effects: Sequence[str] = ()) -> Derived:
    """Regroup, then write the programs of a model.

    Inputs, k a joint's label: c{k}, s{k} (cos and sin of a revolute q), q{k}, dq{k}, ddq{k}, sign{k}, chi{b}.
    `columns` gives the inertial entries of W that differ from each other, `torque` one output per channel.
    """
    rules = derive_rules(robot, model_name, payload)
    return derive_from_rules(rules, effects)


def inertial_columns(rules: Rules) -> Columns:
    """The columns that the base parameters keep; a payload's may be sums of the robot's own."""
    own = {
        (b.keeps.row, b.keeps.kind) for b in rules.base if b.keeps.kind in INERTIAL and not b.keeps.payload
    }
    parameter = {p.name: p for p in rules.standard if not p.payload}
    sums: dict[tuple[int, str], tuple[tuple[int, int, str], ...]] = {}
    direct: dict[int, set[str]] = {}
    for row, kind in own:
        direct.setdefault(row, set()).add(kind)
    for base in rules.base:
        p = base.keeps
        if p.kind not in INERTIAL or (p.row, p.kind) in own:
            continue
        column = rules.columns.get(f"{p.kind}{p.row}", {})
        terms = [(c, parameter[name]) for name, c in column.items()]
        plain = all(c in (1, -1) and (q.row, q.kind) in own for c, q in terms)
        if terms and plain and len(terms) <= CHEAP_SUM:
            sums[p.row, p.kind] = tuple((int(c), q.row, q.kind) for c, q in terms)
        else:
            direct.setdefault(p.row, set()).add(p.kind)
    return Columns(
        {row: tuple(sorted(kinds, key=INERTIAL.index)) for row, kinds in sorted(direct.items())}, sums
    )


def derive_from_rules(rules: Rules, effects: Sequence[str] = ()) -> Derived:
    """`derive` for rules that are at hand."""
    robot, model = rules.robot, rules.model
    kept = [base.keeps for base in rules.base]
    entries, columns = columns_program(robot, inertial_columns(rules))
    nonzeros: list[list[Any]] = []
    for b, p in enumerate(kept):
        for f, (_, kinds) in enumerate(model.families):
            if p.kind not in kinds:
                continue
            for i, k in enumerate(robot.joint_labels):
                if p.kind in INERTIAL:
                    if (k, p.row, p.kind) in entries:
                        nonzeros.append([f * robot.n + i, b, entries[k, p.row, p.kind]])
                elif p.label == k:
                    signal = f"{SIGNALS[p.kind]}{i}" if p.kind in SIGNALS else "one"
                    nonzeros.append([f * robot.n + i, b, signal])
    added = effect_columns(robot, model, effects, {p.name for p in rules.standard} | set(rules.parameters))
    terms: list[sp.Expr] = []
    for column in added:
        for sign in dict.fromkeys(sign for _, sign in column.channels):
            place = len(columns.outputs) + len(terms)
            b = len(kept) + added.index(column)
            nonzeros += [[channel, b, place] for channel, s in column.channels if s == sign]
            terms.append(sign * column.term)
    names = [column.name for column in added]
    torque = torque_program(robot, model, kept)
    description = {
        "format": FORMAT,
        "robot": robot.name,
        "model": model.name,
        "payload": rules.payload,
        "effects": list(effects),
        "joints": _joints(robot),
        "channels": list(rules.channels),
        "parameters": [*rules.parameters, *names],
        "standard_parameters": [*(p.name for p in rules.standard), *names],
        "rules": {**{base.name: regroups(base) for base in rules.base}, **{name: name for name in names}},
        "regroup": {
            **{
                base.name: {name: float(robot.value(c)) for name, c in base.combination.items()}
                for base in rules.base
            },
            **{name: {name: 1.0} for name in names},
        },
        "unidentifiable": list(rules.unidentifiable),
        "columns": len(columns.outputs) + len(terms),
        "nonzeros": sorted(nonzeros, key=lambda entry: (entry[0], entry[1])),
        "extra_inputs": list(dict.fromkeys(name for column in added for name in column.extra_inputs)),
        "operations": {**_count(columns.operations), "torque": _count(torque.operations)},
        "geometry": geometry(robot).document(),
        **({"standard_values": dict(robot.standard_values)} if robot.standard_values else {}),
        **({"notes": list(robot.notes)} if robot.notes else {}),
    }
    return Derived(description, columns, tuple(terms), torque)


def _joints(robot: Robot) -> list[dict[str, Any]]:
    """Label and kind of each moving joint; its own name and its limits where the robot file gives them."""
    found: list[dict[str, Any]] = []
    for j, k, name in zip(robot.moving, robot.joint_labels, robot.joint_names):
        own: dict[str, Any] = {} if name == f"q{k}" else {"name": name}
        if own and k != str(j):
            own["row"] = j
        stated = asdict(robot.link(j).limits or Limits())
        limits = {name: value for name, value in stated.items() if value is not None}
        found.append(
            {
                "label": k,
                "prismatic": robot.link(j).sigma == 1,
                **own,
                **({"limits": limits} if limits else {}),
            }
        )
    return found


def _count(operations: Operations) -> dict[str, int]:
    return {"add": operations.add, "mul": operations.mul}
