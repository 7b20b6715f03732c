"""Robots with a slide along gravity that people have: TIAGo's lifting torso, a SCARA's quill, gantries.

On such a slide the weight, the rotor's acceleration and the offset are tied: M (ddq + g), Iam ddq, Off 1.
The truth is the numeric rank of Pinocchio's regressor with rotors and offsets, and the rules themselves at
rational states.
"""

import json

import pytest
from pinocchio_robot import numeric_base_count

from modelgen.base_parameters.rule_check import broken_columns
from modelgen.base_parameters.rules import derive_rules
from modelgen.geometry.robot_file import load_robot, parse_robot

# TIAGo without wheels, as PAL Robotics publish it: joint, parent, type, placement (xyz m, rpy rad)
H = 1.57079632679
TIAGO = (
    ("torso_lift", "base", "prismatic", (-0.062, 0, 0.79), (0, 0, 0)),
    ("head_1", "torso_lift", "revolute", (0.182, 0, 0), (0, 0, 0)),
    ("head_2", "head_1", "revolute", (0.005, 0, 0.098), (H, 0, 0)),
    ("arm_1", "torso_lift", "revolute", (0.15505, 0.014, -0.151), (0, 0, -H)),
    ("arm_2", "arm_1", "revolute", (0.125, 0.0165, -0.031), (H, 0, 0)),
    ("arm_3", "arm_2", "revolute", (0.0895, 0, 0.0015), (-H, 0, H)),
    ("arm_4", "arm_3", "revolute", (-0.02, -0.027, -0.222), (-H, -H, 0)),
    ("arm_5", "arm_4", "revolute", (-0.162, 0.02, 0.027), (0, -H, 0)),
    ("arm_6", "arm_5", "revolute", (0, 0, 0.15), (0, -H, -H)),
    ("arm_7", "arm_6", "revolute", (0, 0, 0), (H, 0, H)),
)


def tiago(folder, *, head: bool):
    """TIAGo as a URDF file, read as any user's is."""
    lines = ['<robot name="tiago"><link name="base"/>']
    for name, parent, kind, xyz, rpy in TIAGO:
        if name.startswith("head") and not head:
            continue
        lines.append(
            f'<link name="{name}"/><joint name="{name}_joint" type="{kind}"><parent link="{parent}"/>'
            f'<child link="{name}"/><origin xyz="{xyz[0]} {xyz[1]} {xyz[2]}" '
            f'rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/><axis xyz="0 0 1"/>'
            '<limit lower="-2" upper="2" effort="50" velocity="2"/></joint>'
        )
    file = folder / "tiago.urdf"
    file.write_text("\n".join([*lines, "</robot>"]))
    return load_robot(str(file))


def gantry(slides: int, wrist: int, gravity):
    """Slides at right angles to each other, the first along z, then turning joints about crossed axes."""
    links = []
    for j in range(1, slides + wrist + 1):
        row = {"joint": "prismatic" if j <= slides else "revolute", "antecedent": j - 1}
        row |= {"alpha": 0 if j == 1 else "pi/2", "d": 0 if j <= slides else 0.1}
        row |= {"theta": "pi/2", "r": f"q{j} + 0.1"} if j <= slides else {"theta": f"q{j}", "r": 0}
        links.append(row)
    table = {"name": "gantry", "convention": "mdh", "gravity": list(gravity), "links": links}
    return parse_robot(json.dumps(table))


def agrees(robot, model):
    rank, gap = numeric_base_count(robot, model)
    rules = derive_rules(robot, model)
    assert gap > 1e6  # nothing to doubt about the rank
    assert len(rules.base) == rank
    assert broken_columns(rules, seed=3, states=1) == ()
    return rank


@pytest.mark.parametrize("model", "ABCD")
@pytest.mark.parametrize("head", [False, True], ids=["torso and arm", "with its head"])
def test_tiago(tmp_path, model, head):
    rank = agrees(tiago(tmp_path, head=head), model)
    if model == "A" and not head:
        assert rank == 73  # 74 without the tie


@pytest.mark.parametrize("model", "ABCD")
def test_scara(model):
    assert agrees(load_robot("scara"), model) == {"A": 22, "B": 20, "C": 36, "D": 16}[model]


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (9.81, 0, 0), (0, 9.81, 0), (3, -4, -9), (0, 0, 0)])
@pytest.mark.parametrize(("slides", "wrist"), [(1, 1), (2, 0), (3, 0), (3, 2)])
def test_gantries(slides, wrist, gravity):
    for model in "ABCD":
        agrees(gantry(slides, wrist, gravity), model)
