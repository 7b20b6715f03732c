"""Wrong URDFs: one sentence that names the file and the joint or the line, exit status 2, bounded memory."""

import contextlib
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from urdf_peer import random_urdf

from modelgen import cli
from modelgen.errors import ModelgenError, RobotFileError
from modelgen.geometry.robot_file import load_robot, parse_robot

HEAD = '<?xml version="1.0"?><robot name="r">'


def joint(name="j", kind="revolute", parent="a", child="b", inside='<axis xyz="0 0 1"/>'):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def robot(*elements, links="ab"):
    return HEAD + "".join(f'<link name="{name}"/>' for name in links) + "".join(elements) + "</robot>"


def placed(origin):
    return robot(joint(inside=f"<origin {origin}/>"))


def weighing(mass):
    return f'{HEAD}<link name="a"><inertial><mass value="{mass}"/></inertial></link></robot>'


LONG = [f'<link name="l{k}"/>' + joint(f"j{k}", parent=f"l{k - 1}", child=f"l{k}") for k in range(2, 70)]
LONG = ['<link name="l1"/>' + joint("j1", child="l1"), *LONG]
LIMITS = '<axis xyz="0 0 1"/><limit lower="{}" upper="1" effort="1" velocity="1"/>'
BOMB = '<?xml version="1.0"?><!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><robot name="&b;"/>'
OUTSIDE = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="r">&x;</robot>'

WRONG = [
    ("", "not valid XML .*line 1"),
    ("<robot", "not valid XML .*line 1"),
    (HEAD + "<link></robot>", "mismatched tag"),
    (HEAD + "</robot>", "has no link"),
    (BOMB, "has a DOCTYPE"),
    (OUTSIDE, "has a DOCTYPE"),
    ('<?xml version="1.0" encoding="klingon"?><robot/>', "encoding"),
    ("<a>" * 200, "inside each other"),
    (HEAD + "<link/>" * 100_001 + "</robot>", "more than 100000 elements"),
    ("<sdf version='1.7'/>", "is an SDF and no URDF"),
    ("<mujoco/>", "is an MJCF and no URDF"),
    ("<html/>", "XML file of <html> and no URDF"),
    (robot(links="a"), "no moving joint"),
    (robot(joint(kind="fixed")), "no moving joint"),
    (robot(joint(), joint()), "two joints named j"),
    (robot(joint(), links="aab"), "two links named a"),
    (robot(joint(child="c")), "joint j has the child c, which is no link"),
    (robot(joint(parent="c")), "joint j has the parent c, which is no link"),
    (robot(joint(), links="abc"), r"2 root links \(a, c\)"),
    (robot(joint(), joint("k", parent="b", child="a")), r"run in a circle \(j, k\)"),
    (robot(joint(), joint("k", parent="c"), links="abc"), "link b is the child of the joints j and k"),
    (
        robot(joint(), joint("k", parent="c", child="d"), joint("m", parent="d", child="c"), links="abcd"),
        "the joints k, m run in a circle",
    ),
    (robot(joint(kind="floating")), "joint j is of type floating"),
    (robot(joint(kind="planar")), "joint j is of type planar"),
    (robot(joint(kind="")), "joint j is of type none"),
    (robot(joint(inside='<mimic joint="k"/>')), "joint j mimics another joint"),
    (robot(joint(inside='<axis xyz="0 0 0"/>')), "joint j has the axis 0 0 0"),
    (robot(joint(inside='<axis xyz="0 0"/>')), "joint j, axis is '0 0'; write three numbers"),
    (placed('xyz="0 nan 0"'), "joint j, xyz is 'nan' and no number"),
    (placed('xyz="0 1,5 0"'), "joint j, xyz is '1,5' and no number"),
    (placed('xyz="0 1e9 0"'), "joint j, xyz is 1e9; check its unit"),
    (placed('xyz="0 500 0"'), "joint j, xyz is 500 m, longer than any robot's link; 0.5"),
    (placed('rpy="90 0 0"'), r"joint j, rpy is 90 rad, .*; pi/2"),
    (placed('xyz="0 1e999999999 0"'), "no number"),
    (placed('quat_xyzw="0 0 0 1"'), "write the rotation as rpy"),
    (robot(joint(inside=LIMITS.format(2))), "joint j has limits from 2 to 1"),
    (robot(joint(inside=LIMITS.format("x"))), "joint j, limit lower is 'x' and no number"),
    (robot(joint(name="x" * 81)), "at most 80 characters"),
    (robot(joint(name="  ")), "give it a name"),
    (robot('<joint name="j" type="revolute"><child link="b"/></joint>'), "joint j has no parent link"),
    (robot(joint(), '<xacro:macro name="m"/>').replace("<robot", '<robot xmlns:xacro="x"'), "xacro"),
    (placed('xyz="${a} 0 0"'), r"not expanded .*; run: xacro arm.urdf.xacro > arm.urdf"),
    (robot(joint(), '<link name="$(arg p)link"/>'), "not expanded"),
    (robot(*LONG, links="a"), "64 moving joints"),
    (weighing("-1"), "link a, inertial has the mass -1 kg"),
    (weighing("1 kg"), "link a, inertial, mass is '1 kg' and no number"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "says"), WRONG, ids=[says[:40] for _, says in WRONG])
def test_one_sentence(text, says):
    with pytest.raises(RobotFileError, match=says) as refused:
        parse_robot(text, "arm.urdf")
    message = str(refused.value)
    assert message.startswith("arm.urdf: ") and "\n" not in message and len(message) < 400


def test_the_command_ends_with_2(tmp_path, capsys):
    (tmp_path / "arm.urdf").write_text(robot(joint(), joint()))
    assert cli.run([str(tmp_path / "arm.urdf"), "--rules-only"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_xacro_is_refused_with_the_command_that_expands_it(tmp_path):
    for name, target in (("arm.urdf.xacro", "arm.urdf"), ("arm.xacro", "arm.urdf")):
        (tmp_path / name).write_text(robot(joint()))
        with pytest.raises(RobotFileError, match=f"run: xacro {name} > {target}$"):
            load_robot(tmp_path / name)


def test_large_files_are_refused_before_they_are_read(tmp_path):
    path = tmp_path / "arm.urdf"
    with path.open("wb") as stream:
        stream.write(HEAD.encode())
        stream.truncate(1 << 33)  # sparse
    with pytest.raises(RobotFileError, match="larger than 8 MiB"):
        load_robot(path)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 10_000), st.data())
def test_mutated_urdfs_are_read_or_refused(seed, data):
    """Cut, doubled or replaced pieces never end in another exception."""
    text = random_urdf(random.Random(seed))
    start = data.draw(st.integers(0, len(text) - 1))
    stop = data.draw(st.integers(start, min(start + 60, len(text))))
    piece = data.draw(
        st.sampled_from(["", text[start:stop] * 2, "<", "0", "e9", "-", "nan", "&x;", '"', "\x00"])
    )
    with contextlib.suppress(ModelgenError):
        parse_robot((text[:start] + piece + text[stop:]).encode(), "arm.urdf")
