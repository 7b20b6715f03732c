"""One model of one robot, ready to be emitted: its description as plain data, and its programs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from modelgen.customized_newton_euler import Choices, regressor
from modelgen.graph import Graph, Program
from modelgen.kinematics import geometry, state
from modelgen.models import model as find_model
from modelgen.models import standard_regressor
from modelgen.newton_euler import INERTIAL
from modelgen.robot import Robot

SIGNALS = {"Iam": "ddq", "Fvm": "dq", "Fvl": "dq", "Fcm": "sign", "Fcl": "sign", "Offm": "one", "Offl": "one"}


@dataclass(frozen=True, slots=True)
class Derived:
    """`description` is what `generated` reads beside the C; `columns` computes the inertial entries."""

    description: dict[str, Any]
    columns: Program


def derive(robot: Robot, model_name: str, payload: str | None = None) -> Derived:
    """Regroup, then write the program of the base columns."""
    model = find_model(model_name)
    parameters = model.standard_parameters(robot, payload)
    names = [p.name for p in parameters]
    body = [p for p in parameters if not p.payload]
    regroup = _numeric_regrouping(robot, model, body)
    unidentifiable = [p.name for p in body if not any(p.name in rule for rule in regroup.values())]
    regroup |= {p.name: {p.name: 1.0} for p in parameters if p.payload}
    kept = {next(iter(rule)): base for base, rule in regroup.items()}
    by_name = {p.name: p for p in parameters}

    columns: dict[int, list[str]] = {}
    for name in kept:
        p = by_name[name]
        if p.kind in INERTIAL and p.kind not in columns.setdefault(p.row, []):
            columns[p.row].append(p.kind)
    entries, program = _cheapest(robot, columns)
    channels = model.channels(robot)
    n = robot.n
    nonzeros: list[list[Any]] = []
    label_of = dict(zip(robot.moving, robot.joint_labels))
    for b, name in enumerate(kept):
        p = by_name[name]
        for f, (_, kinds) in enumerate(model.families):
            if p.kind not in kinds:
                continue
            for i, k in enumerate(robot.joint_labels):
                channel = f * n + i
                if p.kind in INERTIAL:
                    value = entries.get((k, p.row, p.kind))
                    if value is not None:
                        nonzeros.append([channel, b, value])
                elif label_of[p.row] == k:
                    signal = SIGNALS[p.kind]
                    nonzeros.append([channel, b, signal if signal == "one" else f"{signal}{i}"])
    nonzeros.sort(key=lambda e: (e[0], e[1]))
    description = {
        "robot": robot.name,
        "model": model_name,
        "payload": payload,
        "joints": [{"label": k, "prismatic": robot.link(j).sigma == 1} for j, k in label_of.items()],
        "parameters": list(regroup),
        "channels": list(channels),
        "standard_parameters": names,
        "rules": {b: " + ".join(_term(c, s) for s, c in rule.items()) for b, rule in regroup.items()},
        "regroup": regroup,
        "unidentifiable": unidentifiable,
        "nonzeros": nonzeros,
        "operations": {"add": program.operations.add, "mul": program.operations.mul},
    }
    return Derived(description, program)


def _term(c: float, name: str) -> str:
    return name if c == 1 else f"{c:g}*{name}"


def _cheapest(robot: Robot, columns: dict[int, list[str]]) -> tuple[dict, Program]:
    best: tuple[dict, Program] | None = None
    for choices in (Choices(True, 2), Choices(False, 2), Choices(True, 3), Choices(True, 99)):
        graph = Graph()
        found = regressor(robot, graph, columns, choices)
        distinct = {value.key: value for value in found.values()}
        program = graph.program(list(distinct.values()))
        if best is None or program.operations.total < best[1].operations.total:
            place = {key: k for k, key in enumerate(distinct)}
            best = ({key: place[value.key] for key, value in found.items()}, program)
    assert best is not None
    return best


def _numeric_regrouping(robot: Robot, model: Any, body: Any) -> dict[str, dict[str, float]]:
    rng = np.random.default_rng(0)
    shape = (60, robot.n)
    q, dq, ddq = rng.uniform(-3, 3, shape), rng.uniform(-2, 2, shape), rng.uniform(-5, 5, shape)
    s = state(robot, q, dq, ddq)
    sign = tuple(rng.choice([-1.0, 1.0], shape).T)
    columns = standard_regressor(robot, geometry(robot), model, s, sign, body)
    last = {"M": 3, "MZ": 2, "YY": 1}

    def rank(k: int) -> tuple[int, int]:
        p = body[k]
        return (last.get(p.kind, 2 if p.kind == "Iam" and p.row <= 2 else 0), k)

    order = sorted(range(len(body)), key=rank)
    W = np.array(
        [
            np.concatenate([np.broadcast_to(np.asarray(e, float), 60) for e in columns[body[k].name]])
            for k in order
        ]
    ).T
    R = np.linalg.qr(W, mode="r")
    kept: list[int] = []
    for k in range(len(order)):
        A = R[:, [*kept, k]]
        if np.linalg.norm(A[:, -1]) < 1e-9:
            continue
        coefficients, *_ = np.linalg.lstsq(A[:, :-1], A[:, -1], rcond=None)
        if np.linalg.norm(A[:, -1] - A[:, :-1] @ coefficients) > 1e-7 * np.linalg.norm(A[:, -1]):
            kept.append(k)
    solution = np.linalg.lstsq(R[:, kept], R, rcond=None)[0]
    rules: dict[str, dict[str, float]] = {}
    for row, k in sorted(enumerate(kept), key=lambda e: order[e[1]]):
        rule = {body[order[k]].name: 1.0}
        for m in range(len(order)):
            if m != k and abs(solution[row, m]) > 1e-9:
                rule[body[order[m]].name] = float(np.round(solution[row, m], 9))
        rules[body[order[k]].name + ("R" if len(rule) > 1 else "")] = rule
    return rules
