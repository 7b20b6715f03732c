"""Mutated robot files: read, and where they are small derived too, for that is where odd numbers break."""

from __future__ import annotations

import copy
import random
from functools import cache
from typing import Any

import yaml
from hypothesis import strategies as st
from random_robots import random_table, sliding_table

from modelgen.base_parameters.rules import derive_rules
from modelgen.geometry.robot_file import LINK_KEYS, ROBOT_KEYS, parse_robot
from tests.reliability.judge import Case
from tests.reliability.mutations import Planted, Tree, mutated

CHUNK = 500
MOST_DERIVED = 3  # links
ARM: Tree = {
    "name": "arm",
    "convention": "mdh",
    "gravity": [0, 0, -9.81],
    "constants": {"rl3": 0.4},
    "links": [
        {"joint": "revolute", "antecedent": 0, "alpha": 0, "d": 0, "theta": "q1", "r": 0},
        {"joint": "revolute", "antecedent": 1, "alpha": "pi/2", "d": 0.3, "theta": "q2 - pi/2", "r": "rl3"},
        {"joint": "prismatic", "antecedent": 2, "alpha": "-pi/2", "d": 0, "theta": 0, "r": "q3 + rl3",
         "gamma": 0.1, "b": 0.2, "name": "tip", "limits": {"q": [-1, 1], "dq": 2, "tau": 50}},
    ],
    "payloads": {"L": 3},
}  # fmt: skip


@cache
def bases() -> tuple[Tree, ...]:
    """The small arm most often, random tables, and built-in robots."""
    from importlib.resources import files

    robots = files("modelgen").joinpath("robots")
    built_in = [yaml.safe_load(robots.joinpath(f"{n}.yaml").read_text()) for n in ("kuka_lwr4p", "ur10e")]
    drawn = [random_table(random.Random(seed), 3) for seed in range(3)]
    return (ARM, ARM, ARM, *drawn, *(sliding_table(random.Random(seed)) for seed in range(3)), *built_in)


def trial(data: bytes) -> None:
    """Read a robot file; derive a small one."""
    robot = parse_robot(data, "robot.yaml")
    robot.remarks  # noqa: B018
    if len(robot.links) <= MOST_DERIVED:
        derive_rules(robot, "A", next(iter(robot.payloads), None))


def _link(key: str, value: Any) -> Any:
    """Change the last moving link."""

    def change(tree: Tree) -> None:
        row = next(row for row in reversed(tree["links"]) if row["joint"] != "fixed")
        row[key] = f"{row[key]} {value}" if isinstance(value, str) and value[0] in "+-" else value

    return change


def _key(key: str, value: Any) -> Any:
    def change(tree: Tree) -> None:
        tree[key] = copy.deepcopy(value)

    return change


def _lengths_in_mm(tree: Tree) -> None:
    tree["links"][0]["d"] = 400
    tree["constants"] = {name: 1000 * value for name, value in tree.get("constants", {}).items()}


def _limits_in_degrees(tree: Tree) -> None:
    row = next((row for row in tree["links"] if row["joint"] == "revolute"), None)
    if row is None:
        tree["gravity"] = []
    else:
        row["limits"] = [-170, 170]


def _twice(tree: Tree) -> bytes:
    from tests.reliability.mutations import text_of

    return text_of(tree)[:-1] + b', "name": "other"}'


PLANTED: Planted = (
    *((f"alpha {a} degrees", _link("alpha", a)) for a in (90, -90, 180, 45, "30*3", "-90.0")),
    ("theta in degrees", _link("gamma", -90)),
    *((f"gravity {g}", _key("gravity", [0, 0, g])) for g in (-9810, -98.1, -1, "nan")),
    ("gravity of two numbers", _key("gravity", [0, -9.81])),
    ("gravity infinite", _key("gravity", [0, 0, float("inf")])),
    ("lengths in mm", _lengths_in_mm),
    ("limits in degrees", _limits_in_degrees),
    ("limits upside down", _link("limits", {"q": [1, -1]})),
    ("unknown key", _key("gravitas", 1)),
    ("unknown key of a link", _link("alhpa", 0)),
    ("another convention", _key("convention", "dh")),
    ("a name twice", _twice),
    ("a cycle", lambda tree: tree["links"][0].update(antecedent=1)),
    ("nested powers", _link("d", "((2**8)**8)**8")),
    ("a power tower", _link("d", "9**9**9")),
    ("division by zero", _link("d", "1/0")),
    ("code", _link("d", "__import__('os').system('true')")),
    ("an unknown name", _link("d", "rl99")),
    ("true for a length", _link("d", True)),
    ("a payload that reads as a first moment", _key("payloads", {"X1": 1})),
    ("a payload nowhere", _key("payloads", {"M": 0})),
    ("no links", _key("links", [])),
    ("a joint of no kind", _link("joint", "spherical")),
    ("an alias", lambda tree: b"name: &a arm\nconvention: *a\n"),
    ("1,000 links", lambda tree: tree.update(links=tree["links"] * 1000)),
)  # fmt: skip


def cases() -> st.SearchStrategy[Case]:
    """Mutated robot files."""
    return mutated(bases, lambda: PLANTED, sorted(ROBOT_KEYS | LINK_KEYS))
