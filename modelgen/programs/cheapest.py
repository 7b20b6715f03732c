"""The two programs of a model, each the cheapest of the known ways: its inertial columns, and its torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from modelgen.dynamics.models import Model
from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.dynamics.standard_parameters import StandardParameter
from modelgen.geometry.robot import Robot
from modelgen.programs.customized_newton_euler import Choices, regressor
from modelgen.programs.customized_torque import Moved, moved, torque
from modelgen.programs.graph import Graph, Program, Scalar
from modelgen.programs.signs import oriented

Entry = tuple[str, int, str]  # (label of the torque's joint, link, parameter's kind)


@dataclass(frozen=True, slots=True)
class Columns:
    """Inertial columns to compute, {link: kinds}; and sums of them: (link, kind) -> signed terms."""

    direct: Mapping[int, tuple[str, ...]]
    sums: Mapping[tuple[int, str], tuple[tuple[int, int, str], ...]]  # (sign, link, kind)

    @property
    def key(self) -> tuple:
        """Equal keys, equal programs (of one robot)."""
        return tuple(sorted(self.direct.items())), tuple(sorted(self.sums.items()))


def columns_program(robot: Robot, columns: Columns) -> tuple[dict[Entry, int], Program]:
    """Regressor entries of the given columns: where each stands among the program's outputs.

    Equal entries are computed once; entries that no motion can make differ from zero are left out.
    """
    best: tuple[int, dict[Entry, Scalar], Graph] | None = None
    for choices in (
        Choices(True, 2),
        Choices(False, 2),
        Choices(True, 3),
        Choices(True, len(robot.links) + 1),
    ):
        graph = Graph()
        found = regressor(robot, graph, columns.direct, choices)
        for (j, kind), terms in columns.sums.items():
            for k in robot.joint_labels:
                total = graph.zero
                for sign, link, other in terms:
                    entry = found.get((k, link, other), graph.zero)
                    total = total + entry if sign > 0 else total - entry
                if not total.is_zero:
                    found[k, j, kind] = total
        operations = graph.operations(found.values()).total
        if best is None or operations < best[0]:
            best = operations, found, graph
    assert best is not None
    _, found, graph = best
    distinct = {value.key: value for value in found.values()}
    place = {key: k for k, key in enumerate(distinct)}
    program = graph.program(list(distinct.values()))
    return {entry: place[value.key] for entry, value in found.items()}, oriented(program)


def torque_program(robot: Robot, model: Model, kept: Sequence[StandardParameter]) -> Program:
    """Torques of the model's channels for base parameters chi0, chi1, ... of which `kept` are the columns.

    Inputs besides those of the columns: sign{k}, chi{b}.
    """
    shifts = [
        j for j, link in enumerate(robot.links, 1) if link.sigma != 1 and not robot.value(link.r).is_zero
    ]
    graph = Graph()  # shared by all trials: what they have in common is written once
    motion = moved(robot, graph)

    def cost(choices: Choices) -> int:
        return graph.operations(_torque(robot, model, kept, choices, graph, motion)).total

    chosen = min((Choices(lines=lines) for lines in (False, True)), key=cost)
    least, shifted = cost(chosen), frozenset[int]()
    for j in shifts:
        trial = Choices(shifted=shifted | {j})
        if (operations := cost(trial)) < least:
            chosen, least, shifted = trial, operations, trial.shifted
    graph = Graph()
    return oriented(graph.program(_torque(robot, model, kept, chosen, graph)))


def _torque(
    robot: Robot,
    model: Model,
    kept: Sequence[StandardParameter],
    choices: Choices,
    graph: Graph,
    motion: Moved | None = None,
) -> list[Scalar]:
    """One torque per channel."""
    inertial: dict[tuple[int, str], Scalar] = {}
    for b, p in enumerate(kept):
        if p.kind in INERTIAL:
            key = (p.row, p.kind)
            inertial[key] = (
                inertial[key] + graph.input(f"chi{b}") if key in inertial else graph.input(f"chi{b}")
            )
    links = torque(robot, graph, inertial, choices, motion) if inertial else {}
    rows: dict[str, dict[str, Scalar]] = {}
    done: dict[tuple[str, ...], dict[str, Scalar]] = {}
    for prefix, kinds in sorted(model.families, key=lambda family: len(family[1])):
        inner = next((known for known in done if set(known) <= set(kinds)), ())
        tau = dict(done[inner]) if inner else {k: links.get(k, graph.zero) for k in robot.joint_labels}
        if not inner and not set(INERTIAL) <= set(kinds):
            tau = dict.fromkeys(robot.joint_labels, graph.zero)
        for b, p in enumerate(kept):
            if p.kind in kinds and p.kind not in inner and p.kind not in INERTIAL:
                tau[p.label] = tau[p.label] + graph.input(f"chi{b}") * drive_signal(graph, p)
        done[kinds] = rows[prefix] = tau
    return [rows[prefix][k] for prefix, _ in model.families for k in robot.joint_labels]


SIGNALS = {"Iam": "ddq", "Fvm": "dq", "Fvl": "dq", "Fcm": "sign", "Fcl": "sign"}


def drive_signal(graph: Graph, p: StandardParameter) -> Scalar:
    """What a drive parameter multiplies (paper eq. 4): ddq, dq, sign(dq) or 1."""
    return graph.input(SIGNALS[p.kind] + p.label) if p.kind in SIGNALS else graph.one
