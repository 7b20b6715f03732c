"""Robots of many joints: derived in seconds, with the programs that were found one by one."""

import json

from hypothesis import given, settings
from random_robots import robots

from modelgen.base_parameters.rules import derive_rules
from modelgen.dynamics.models import model
from modelgen.emit import c_code
from modelgen.emit.description import derive_from_rules
from modelgen.geometry.robot_file import parse_robot
from modelgen.programs import cheapest
from modelgen.programs.customized_newton_euler import Choices
from modelgen.programs.customized_torque import moved
from modelgen.programs.graph import Graph


def revolute_chain(joints):
    links = [
        {
            "joint": "revolute",
            "antecedent": j - 1,
            "alpha": ("pi/2", "0", "-pi/2")[j % 3],
            "d": round(0.1 + 0.01 * j, 2),
            "theta": f"q{j}",
            "r": 0.2,
        }
        for j in range(1, joints + 1)
    ]
    table = {"name": "chain", "convention": "mdh", "gravity": [0, 0, -9.81], "links": links}
    return parse_robot(json.dumps(table))


def test_forty_joints_are_derived_and_written():
    robot = revolute_chain(40)
    rules = derive_rules(robot, "A")
    derived = derive_from_rules(rules)
    text = c_code.source(derived, c_code.provenance("0"))
    assert len(rules.channels) == 40 and "chain_A_columns" in text


@settings(max_examples=10, deadline=None, derandomize=True)
@given(robots(6))
def test_a_trial_in_a_shared_graph_costs_what_it_costs_alone(robot):
    chosen = model("C")
    kept = [b.keeps for b in derive_rules(robot, "C").base]
    shared = Graph()
    motion = moved(robot, shared)
    for choices in (Choices(), Choices(lines=True), Choices(shifted=frozenset({1, 2}))):
        alone = Graph()
        program = alone.program(cheapest._torque(robot, chosen, kept, choices, alone))
        trial = cheapest._torque(robot, chosen, kept, choices, shared, motion)
        assert shared.operations(trial) == program.operations
