"""Base parameters: counts against an independent program's numeric rank, rules exactly at rational states."""

import json
import random

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from pinocchio_robot import numeric_base_count
from random_robots import named_length_chain, random_robot, random_table, robots, sliding_robot
from sympy.polys.domains import QQ
from sympy.polys.matrices import DomainMatrix

from modelgen.base_parameters.regrouping import regroup_inertial
from modelgen.base_parameters.rule_check import broken_columns, rational_state
from modelgen.base_parameters.rules import derive_rules
from modelgen.dynamics.newton_euler import INERTIAL, regressor
from modelgen.geometry.kinematics import geometry
from modelgen.geometry.robot_file import built_in_names, load_robot, parse_robot


def chain(*rows, gravity=(0, 0, -9.81)):
    """A serial robot from short rows: (joint, alpha, d, constant theta or r)."""
    links = []
    for j, (joint, alpha, d, constant) in enumerate(rows, 1):
        row = {"joint": joint, "antecedent": j - 1, "alpha": alpha, "d": d, "theta": 0, "r": 0}
        if joint == "revolute":
            row["theta"] = f"q{j} + {constant}"
        elif joint == "prismatic":
            row["r"] = f"q{j} + {constant}"
        else:
            row["theta"] = constant
        links.append(row)
    return parse_robot(
        json.dumps({"name": "chain", "convention": "mdh", "gravity": list(gravity), "links": links})
    )


def kept(robot, drives=False):
    return set(regroup_inertial(robot, drives).kept)


def agrees_with_the_numeric_rank(robot, models="AB", payloads=(None,)):
    for model in models:
        for payload in payloads:
            row = robot.payload_link(payload) if payload else None
            rank, gap = numeric_base_count(robot, model, row)
            assert gap > 1e4  # the singular values leave no doubt
            assert len(derive_rules(robot, model, payload).base) == rank


@pytest.mark.parametrize("name", built_in_names())
def test_counts_of_built_in_robots(name):
    robot = load_robot(name)
    agrees_with_the_numeric_rank(robot)
    # as the READMEs of the recordings found numerically; the others have the rank alone
    if name not in ("scara", "two_armed_torso"):
        assert len(kept(robot)) == {7: 43, 6: 36}[robot.n]


@pytest.mark.parametrize("seed", range(20))
def test_counts_of_random_robots(seed):
    agrees_with_the_numeric_rank(random_robot(seed))


@pytest.mark.parametrize("seed", range(24))
def test_counts_where_slides_lie_along_across_and_oblique_to_gravity(seed):
    """With offsets, which a weight on a slide resembles, for all models, with and without a payload."""
    agrees_with_the_numeric_rank(sliding_robot(seed), "ABCD", (None, "L"))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from("ABCD"), st.sampled_from([None, "L"]))
def test_rules_of_sliding_robots_hold_exactly(seed, model, payload):
    assert broken_columns(derive_rules(sliding_robot(seed), model, payload), seed=7, states=1) == ()


def test_a_vertical_slide_ties_its_rotor_its_weight_and_its_offset():
    """Of M (ddq + g), Iam ddq and Off 1 only two can be told apart; a tilt that changes tells all three."""
    scara = chain(
        ("revolute", 0, 0, 0), ("revolute", 0, 0.4, 0), ("prismatic", "pi", 0.3, 0.1), ("revolute", 0, 0, 0)
    )
    rules = derive_rules(scara, "A")
    combination = {b.name: b.combination for b in rules.base}
    assert len(rules.base) == 22 and "Iam3" not in combination
    assert combination["Offm3R"] == {"Offm3": 1, "Offl3": 1, "Iam3": sp.Rational("9.81")}  # axis downwards
    assert combination["M3R"] == {"M3": 1, "M4": 1, "Iam3": 1}
    assert len(derive_rules(scara, "C").base) == 36  # the sensor has no rotor: nothing is tied
    swung = chain(("revolute", "pi/2", 0, 0), ("prismatic", "pi/2", 0.3, 0.1))
    assert {"Iam2", "Offm2", "M2"} <= kept(swung, drives=True)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(robots(7), st.sampled_from("ABC"), st.sampled_from([None, "L"]))
def test_rules_hold_exactly_at_fresh_rational_states(robot, model, payload):
    assert broken_columns(derive_rules(robot, model, payload), seed=7, states=1) == ()


@pytest.mark.parametrize("model", "ABCD")
def test_rules_of_the_lwr_hold_exactly_with_its_lengths_as_symbols(model):
    assert broken_columns(derive_rules(load_robot("kuka_lwr4p"), model, "L")) == ()


@pytest.mark.parametrize("name", ["kuka_lwr4p", "ur10e"])
def test_the_count_is_the_exact_rank_at_rational_states(name):
    """The slow twin: no theorem, just the regressor's columns in rational numbers and their rank over QQ."""
    robot = load_robot(name)
    g = geometry(robot, lambda e: QQ(e.p, e.q))
    columns = [(j, kind) for j in range(1, robot.n + 1) for kind in INERTIAL]
    rows: list[list] = []
    for seed in range(12):
        W = regressor(g, rational_state(robot, seed), columns)
        rows += [[QQ(W[c][i]) for c in columns] for i in range(robot.n)]
    assert DomainMatrix(rows, (len(rows), len(columns)), QQ).rank() == len(kept(robot))


def test_the_check_finds_a_wrong_rule():
    rules = derive_rules(load_robot("kuka_lwr4p"), "B")
    wrong = dict(rules.columns) | {
        "YY3": {**rules.columns["YY3"], "ZZ2": sp.Integer(2)},
        "M1": {"ZZ1": sp.Integer(1)},
    }
    object.__setattr__(rules, "columns", wrong)
    assert set(broken_columns(rules)) == {"YY3", "M1"}


def test_one_pendulum():
    revolute = ("revolute", 0, 0, 0)
    assert kept(chain(revolute)) == {"ZZ1"}  # gravity along the axis
    assert kept(chain(revolute, gravity=(9.81, 0, 0))) == {"ZZ1", "MX1", "MY1"}
    assert kept(chain(revolute, gravity=(6, 0, -8))) == {"ZZ1", "MX1", "MY1"}  # oblique
    assert kept(chain(revolute, gravity=(0, 0, 0))) == {"ZZ1"}
    assert kept(chain(revolute), drives=True) == {"ZZ1", "Offm1"}  # Iam1 moves as ZZ1 does
    assert kept(chain(revolute, gravity=(9.81, 0, 0)), drives=True) == {"ZZ1", "MX1", "MY1", "Offm1"}


def test_one_slider():
    prismatic = ("prismatic", 0, 0, 0)
    assert kept(chain(prismatic), drives=True) == {"M1", "Offm1"}  # only the mass is weighed: as an offset
    assert kept(chain(prismatic, gravity=(9.81, 0, 0)), drives=True) == {"M1", "Offm1"}


def test_parallel_and_antiparallel_axes():
    parallel = chain(*[("revolute", 0, 0.3, 0)] * 3)
    antiparallel = chain(("revolute", 0, 0.3, 0), ("revolute", "pi", 0.3, 0), ("revolute", "pi", 0.3, 0))
    names = {"ZZ1", "ZZ2", "MX2", "MY2", "ZZ3", "MX3", "MY3"}
    assert kept(parallel) == kept(antiparallel) == names


def test_twists_that_undo_each_other_make_parallel_axes():
    """pi/3 three times is pi; 0.3 and -0.3 are nothing; 0.123 + 0.456 - 0.579 is nothing."""
    for twists in (("pi/3", "pi/3", "pi/3"), ("0.3", 0, "-0.3"), ("0.123", "0.456", "-0.579")):
        rows = [("revolute", 0, 0.3, 0), *(("fixed", twist, 0.1, 0) for twist in twists)]
        robot = chain(*rows[:1], *rows[1:], ("revolute", 0, 0.2, 0))
        # q5 is numbered by its row; the axes are (anti)parallel, so the arm is planar
        assert kept(robot) == {"ZZ1", "ZZ5", "MX5", "MY5"}
        agrees_with_the_numeric_rank(robot)


@pytest.mark.first_case
@pytest.mark.parametrize(
    "twists",
    [
        ("pi/5", "pi/7", "2*pi/7"),
        ("pi/12", 0.5, "pi/8"),
        ("tilt", "tilt + pi/2", "-tilt"),
        ("0.3*pi", "pi/6", 1),
    ],
)
def test_any_angle_and_named_ones(twists):
    links = [
        {"joint": "revolute", "antecedent": j, "alpha": a, "d": "pi/10", "theta": f"q{j + 1}", "r": 0.3}
        for j, a in enumerate((0, *twists))
    ]
    table = {
        "name": "a",
        "convention": "mdh",
        "gravity": [0, 0, -9.81],
        "constants": {"tilt": 0.3},
        "links": links,
    }
    robot = parse_robot(json.dumps(table))
    agrees_with_the_numeric_rank(robot)
    assert broken_columns(derive_rules(robot, "A"), states=1) == ()


def test_a_nearly_right_angle_is_not_a_right_angle():
    """1.5708 is not pi/2: exact counting says so, where a tolerance would not know."""
    right = chain(("revolute", 0, 0, 0), ("revolute", "pi/2", 0, 0))
    nearly = chain(("revolute", 0, 0, 0), ("revolute", "1.5708", 0, 0))
    assert len(kept(nearly, drives=True)) == len(kept(right, drives=True)) + 1  # Iam2 parts from ZZ2


def test_fixed_links_regroup_wholly():
    table = random_table(random.Random(5), 4)
    table["links"].append(
        {"joint": "fixed", "antecedent": len(table["links"]), "alpha": 0.2, "d": 1, "theta": 1, "r": 2}
    )
    robot = parse_robot(json.dumps(table))
    last = len(robot.links)
    assert not any(name.endswith(str(last)) for name in kept(robot))


def test_a_link_fixed_to_the_base_shows_nothing():
    robot = chain(("fixed", 0.3, 1, 1), ("revolute", 0, 0.3, 0), gravity=(1, 2, 3))
    columns = regroup_inertial(robot, False).columns
    assert all(columns[name] == {} for name in columns if name.endswith("1"))


def test_a_tree_s_branches_meet_in_their_antecedent():
    table = {
        "name": "tree",
        "convention": "mdh",
        "gravity": [0, 0, -9.81],
        "links": [
            {"joint": "revolute", "antecedent": 0, "alpha": "pi/2", "d": 0, "theta": "q1", "r": 0},
            {"joint": "revolute", "antecedent": 1, "alpha": 0, "d": 0.5, "theta": "q2", "r": 0},
            {
                "joint": "revolute",
                "antecedent": 1,
                "alpha": 0,
                "d": 0.2,
                "theta": "q3",
                "r": 0,
                "gamma": "pi/3",
                "b": 0.1,
            },
        ],
    }
    robot = parse_robot(json.dumps(table))
    agrees_with_the_numeric_rank(robot)
    columns = regroup_inertial(robot, False).columns
    assert columns["M2"] and columns["M3"] and set(columns["M3"]) == {"ZZ1", "MX1", "MY1"}


@pytest.mark.parametrize("joints", [7, 15])
def test_a_chain_of_named_lengths_keeps_its_names(joints):
    robot = named_length_chain(joints)
    rules = derive_rules(robot, "B")
    used = {str(s) for base in rules.base for c in base.combination.values() for s in c.free_symbols}
    assert {f"d{joints}", f"r{joints - 1}"} <= used
    if joints < 10:
        assert broken_columns(rules, states=1) == ()


def test_a_length_named_but_zero_has_the_counts_of_zero():
    table = random_table(random.Random(1), 3)
    for row in table["links"]:
        row["d"] = "e" if row["d"] else 0
    table["constants"] = {"e": 0}
    robot = parse_robot(json.dumps(table))
    agrees_with_the_numeric_rank(robot)
