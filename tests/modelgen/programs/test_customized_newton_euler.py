"""The cheap recursions against the plain one on random chains and trees; what they cost."""

import json
import random

import pytest
from random_robots import random_table

from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.dynamics.newton_euler import regressor as plain_regressor
from modelgen.dynamics.newton_euler import torque as plain_torque
from modelgen.emit.description import derive
from modelgen.geometry.kinematics import geometry, state
from modelgen.geometry.robot_file import load_robot, parse_robot
from modelgen.programs.customized_newton_euler import Choices, regressor
from modelgen.programs.customized_torque import torque
from modelgen.programs.graph import Graph

np = pytest.importorskip("numpy")
CHOICES = (
    Choices(True, 2),
    Choices(False, 1),
    Choices(True, 99, shifted=frozenset(range(1, 20))),
    Choices(lines=True),
)


def samples(robot, rows=4, seed=0):
    q, dq, ddq = np.random.default_rng(seed).normal(size=(3, rows, robot.n))
    inputs = {}
    for i, k in enumerate(robot.joint_labels):
        inputs |= {f"c{k}": np.cos(q[:, i]), f"s{k}": np.sin(q[:, i]), f"q{k}": q[:, i]}
        inputs |= {f"dq{k}": dq[:, i], f"ddq{k}": ddq[:, i]}
    return inputs, state(robot, q, dq, ddq)


@pytest.mark.parametrize("seed", range(24))
def test_random_robots(seed):
    robot = parse_robot(json.dumps(random_table(random.Random(seed))))
    inputs, st = samples(robot)
    columns = [(j, kind) for j in range(1, len(robot.links) + 1) for kind in INERTIAL]
    truth = plain_regressor(geometry(robot), st, columns)
    parameters = dict(zip(columns, np.random.default_rng(seed).normal(size=len(columns))))
    tau = plain_torque(geometry(robot), st, parameters)
    inputs |= {f"p{j}{kind}": value for (j, kind), value in parameters.items()}
    choices = CHOICES[seed % len(CHOICES)]
    graph = Graph()
    entries = regressor(robot, graph, dict.fromkeys(range(1, len(robot.links) + 1), INERTIAL), choices)
    found = dict(zip(entries, graph.program(list(entries.values())).evaluate(inputs)))
    for j, kind in columns:
        for k, expected in zip(robot.joint_labels, truth[j, kind]):
            got = np.broadcast_to(found.get((k, j, kind), 0.0), 4)
            np.testing.assert_allclose(got, np.broadcast_to(expected, 4), rtol=1e-10, atol=1e-10)
    graph = Graph()
    symbols = {key: graph.input(f"p{key[0]}{key[1]}") for key in columns}
    outputs = torque(robot, graph, symbols, choices)
    for got, expected in zip(graph.program(list(outputs.values())).evaluate(inputs), tau):
        np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-10)


def test_the_lwr_costs_less_than_anyone_else_counts():
    derived = derive(load_robot("kuka_lwr4p"), "B")
    assert derived.columns.operations.total <= 1026  # SymPyBotics 1,188, OpenSYMORO 1,257
    friction = 7 * (3 + 2)  # Fvl, Fcl, Offl: three additions, two multiplications a joint
    assert derived.torque.operations.total - friction <= 539  # OpenSYMORO 614


def test_cost_grows_with_the_square_of_the_joints():
    def cost(n):
        rows = [
            {"joint": "revolute", "antecedent": j - 1, "alpha": "pi/2" if j % 2 else "-pi/2", "d": 0.1}
            | {"theta": f"q{j}", "r": 0.2}
            for j in range(1, n + 1)
        ]
        table = {"name": "chain", "convention": "mdh", "gravity": [0, 0, -9.81], "links": rows}
        robot = parse_robot(json.dumps(table))
        graph = Graph()
        entries = regressor(
            robot, graph, dict.fromkeys(range(1, n + 1), ("XX", "XY", "XZ", "YZ", "ZZ", "MX", "MY"))
        )
        return graph.program(list(entries.values())).operations.total

    costs = [cost(n) for n in (6, 9, 12, 15)]
    third_differences = np.diff(costs, 3)
    assert not third_differences.any()  # a polynomial of degree 2 in the number of joints
