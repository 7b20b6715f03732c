"""Random robots of the family that the derivation must handle, seeded, and as a hypothesis strategy.

Chains and trees of 2 to 9 moving joints, revolute and prismatic, with fixed links anywhere; twists 0,
+-pi/2, pi, +-pi/3 and arbitrary; Khalil's gamma and b on branches; gravity along, across or oblique to the
first axis, or none.
"""

from __future__ import annotations

import json
import random

from hypothesis import strategies as st

from modelgen.geometry.robot import Robot
from modelgen.geometry.robot_file import parse_robot

RIGHT = ("0", "pi/2", "-pi/2", "pi")
TWISTS = (*RIGHT, *RIGHT, "pi/3", "-pi/3", "0.3", "-0.3", "1.234")
LENGTHS = (0, 0, 0, 0.4, -0.3, 0.25)
GRAVITY = ([0, 0, -9.81], [0, 0, 9.81], [9.81, 0, 0], [0, -9.81, 0], [3, -4, -9], [6, 0, -8], [0, 0, 0])


def random_table(rng: random.Random, joints: int | None = None) -> dict:
    """The content of a robot file, drawn with `rng`."""
    wanted = joints or rng.randint(2, 9)
    planar = rng.random() < 0.25  # all axes parallel or antiparallel: the hardest case for grouping rules
    tree = rng.random() < 0.3
    prismatic = rng.choice((0.0, 0.0, 0.3, 0.6))
    fixed = rng.choice((0.0, 0.0, 0.2))
    links: list[dict] = []
    moving = 0
    while moving < wanted:
        j = len(links) + 1
        joint = "fixed" if rng.random() < fixed else "prismatic" if rng.random() < prismatic else "revolute"
        antecedent = rng.randint(0, j - 1) if tree and rng.random() < 0.4 else j - 1
        twist = rng.choice(("0", "pi")) if planar else rng.choice(TWISTS)
        constant = rng.choice(("0", "0", "pi/2", "-pi/2", "pi/3", "0.7"))
        length = rng.choice(LENGTHS)
        row = {"joint": joint, "antecedent": antecedent, "alpha": twist, "d": rng.choice(LENGTHS)}
        if joint != "fixed":
            moving += 1
        row["theta"] = f"q{moving} + {constant}" if joint == "revolute" else constant
        row["r"] = f"q{moving} + {length}" if joint == "prismatic" else length
        if antecedent != j - 1 and rng.random() < 0.5:
            row |= {"gamma": rng.choice(TWISTS), "b": rng.choice(LENGTHS)}
        links.append(row)
    if fixed and rng.random() < 0.5:
        links.append(
            {"joint": "fixed", "antecedent": len(links), "alpha": "0.3", "d": 0.1, "theta": "0", "r": 0.2}
        )
    return {"name": "random", "convention": "mdh", "gravity": rng.choice(GRAVITY), "links": links}


def sliding_table(rng: random.Random) -> dict:
    """A robot file with slides among few turns: gantries, SCARAs, lifts; gravity along, across or oblique."""
    twists = rng.choice((("0", "pi"), ("0", "0", "pi/2", "-pi/2"), ("0", "pi/2", "0.3", "pi/3")))
    lengths = (0, 0, 0.4, -0.3)
    links: list[dict] = []
    for j in range(1, rng.randint(1, 5) + 1):
        slides = rng.random() < 0.6
        row = {"joint": "prismatic" if slides else "revolute", "antecedent": j - 1}
        if j > 1 and rng.random() < 0.15:
            row["antecedent"] = rng.randint(0, j - 1)
        row |= {"alpha": rng.choice(twists), "d": rng.choice(lengths)}
        angle, length = rng.choice(("0", "0", "pi/2", "0.7")), rng.choice(lengths)
        row |= {
            "theta": angle if slides else f"q{j} + {angle}",
            "r": f"q{j} + {length}" if slides else length,
        }
        links.append(row)
    gravity = rng.choice((*GRAVITY, [0, 0, -9.81], [0, 0, -9.81]))
    return {"name": "sliding", "convention": "mdh", "gravity": gravity, "links": links}


def sliding_robot(seed: int) -> Robot:
    """The robot of a seed, read through the robot file parser."""
    return parse_robot(json.dumps(sliding_table(random.Random(seed))), f"sliding {seed}")


def random_robot(seed: int, joints: int | None = None) -> Robot:
    """The robot of a seed, read through the robot file parser."""
    return parse_robot(json.dumps(random_table(random.Random(seed), joints)), f"seed {seed}")


def robots(most_joints: int = 9) -> st.SearchStrategy[Robot]:
    """Robots of the family, for hypothesis."""
    return st.builds(random_robot, st.integers(0, 10**6), st.integers(2, most_joints))


def named_length_chain(joints: int) -> Robot:
    """A serial chain with every length a named constant."""
    constants = {
        f"{key}{j}": 0.1 + 0.07 * j + 0.01 * (key == "r") for j in range(1, joints + 1) for key in "dr"
    }
    links = [
        {
            "joint": "revolute",
            "antecedent": j - 1,
            "alpha": ("pi/2", "0", "-pi/2")[j % 3],
            "d": f"d{j}",
            "theta": f"q{j}",
            "r": f"r{j}",
        }
        for j in range(1, joints + 1)
    ]
    table = {
        "name": "chain",
        "convention": "mdh",
        "gravity": [0, 0, -9.81],
        "constants": constants,
        "links": links,
    }
    return parse_robot(json.dumps(table), "chain")
