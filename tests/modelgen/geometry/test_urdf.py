"""URDFs as robots: Pinocchio's kinematics and dynamics of the same file, and names, limits, text.

Rounding in Pinocchio and here is some 1e-16 a joint, and ten times that where a fixed row across almost
parallel axes stands in the exact table.
"""

import random

import numpy as np
import pytest
from urdf_peer import PinocchioUrdf, link_placements, random_urdf, real_files, row_placements, snapped

import generated
from modelgen.cli import run
from modelgen.dynamics.newton_euler import INERTIAL, torque
from modelgen.errors import ModelgenError
from modelgen.geometry.kinematics import geometry, state
from modelgen.geometry.robot_file import load_robot, parse_robot
from modelgen.geometry.robot_text import as_text, robot_text
from modelgen.geometry.urdf import convert

EXACT, SNAPPED, TORQUE = 1e-14, 1e-12, 1e-10


def readable(path):
    """Content and conversion of a URDF that describes a robot for us, else None."""
    data = path.read_bytes()
    try:
        return data, convert(data, path.name)
    except ModelgenError as error:
        assert "\n" not in str(error) and str(error).startswith(path.name)
        return None


REAL = {path: found for path in real_files() if (found := readable(path))}
needs_real = pytest.mark.skipif(not REAL, reason="airo-models and robot-properties-fingers are not installed")


def states(n, count, seed=0):
    return np.random.default_rng(seed).uniform(-3, 3, (count, n))


def distance(conversion, peer, seed=0):
    """Greatest difference of link placements at random positions."""
    worst = 0.0
    for q in states(conversion.robot.n, 3, seed):
        for ours, theirs in zip(link_placements(conversion, q), peer.placements(q)):
            worst = max(worst, float(np.abs(ours - theirs).max()))
    return worst


def rigid_torque(robot, q, dq, ddq):
    """The plain recursion on the URDF's own inertias, (N, n)."""
    bodies = {
        (j, kind): robot.standard_values.get(f"{kind}{j}", 0.0) for j in range(1, 65) for kind in INERTIAL
    }
    tau = torque(geometry(robot), state(robot, q, dq, ddq), bodies)
    return np.stack([np.broadcast_to(np.asarray(x, float), len(q)) for x in tau], axis=1)


def check_torque(robot, peer, seed=1):
    q, dq, ddq = states(robot.n, 15, seed).reshape(3, 5, robot.n)
    ours = rigid_torque(robot, q, dq, ddq)
    theirs = np.array([peer.torque(*row) for row in zip(q, dq, ddq)])
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=TORQUE * max(np.abs(theirs).max(), 1e-3))


@needs_real
def test_at_least_twelve_real_robots_are_read():
    assert len(REAL) >= 12


@needs_real
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.stem)
def test_real_urdfs_move_as_in_pinocchio(path, capfd):
    data, conversion = REAL[path]
    text, robot = data.decode(), conversion.robot
    exact = convert(data, path.name, exact=True)
    assert distance(exact, PinocchioUrdf(text, exact.robot.joint_names)) < EXACT
    off = distance(conversion, PinocchioUrdf(snapped(text), robot.joint_names))
    # what only the table brings close to a right angle is rounded there, and said
    assert off < SNAPPED or (off < 2e-5 and "multiple of pi/2" in robot.notes[0])
    check_torque(exact.robot, PinocchioUrdf(text, robot.joint_names))


@pytest.mark.parametrize("part", [k if k < 4 else pytest.param(k, marks=pytest.mark.long) for k in range(8)])
def test_two_hundred_random_trees(part):
    for seed in range(25 * part, 25 * part + 25):
        text = random_urdf(random.Random(seed))
        exact, rounded = convert(text.encode(), exact=True), convert(text.encode())
        names = rounded.robot.joint_names
        assert distance(exact, PinocchioUrdf(text, names), seed) < EXACT, seed
        peer = PinocchioUrdf(snapped(text), names)
        assert distance(rounded, peer, seed) < SNAPPED, seed
        check_torque(rounded.robot, peer, seed)


@needs_real
@pytest.mark.parametrize("name", ["ur5e", "fingeredu", "trifinger"])
def test_the_model_of_a_urdf_gives_the_urdf_s_torque(name):
    path = next(path for path in REAL if path.stem == name)
    m = generated.load(path, "B")
    peer = PinocchioUrdf(snapped(path.read_text()), m.joint_names)
    q, dq, ddq = states(m.n, 30).reshape(3, 10, m.n)
    theirs = np.array([peer.torque(*row) for row in zip(q, dq, ddq)])
    ours = m.torque(q, dq, ddq, m.regroup(m.standard_values))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=TORQUE * np.abs(theirs).max())


@needs_real
def test_real_robots_as_robot_files_are_the_same_robots():
    for path, (_, conversion) in REAL.items():
        robot = conversion.robot
        text, remarks = robot_text(path)
        again = parse_robot(text)
        assert again.joint_names == robot.joint_names and set(robot.notes) <= set(remarks)
        assert [link.limits for link in again.links] == [link.limits for link in robot.links]
        q = states(robot.n, 1)[0]
        np.testing.assert_allclose(row_placements(again, q), row_placements(robot, q), rtol=0, atol=1e-14)
        assert as_text(again).count("\n  - {") == len(robot.links)


ARM = """<?xml version="1.0"?>
<robot name="two arms">
  <link name="world"/>
  <link name="base"/>
  <joint name="fix" type="fixed"><parent link="world"/><child link="base"/><origin xyz="0 0 0.5"/></joint>
  <link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.2" rpy="1.5708 0 0"/><axis xyz="0 0 -1"/>
    <limit lower="-1" upper="2" effort="30" velocity="1.5"/></joint>
  <link name="lower"/>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit effort="0" velocity="3"/></joint>
  <link name="slider"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="lower"/><child link="slider"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0" effort="0" velocity="1000"/></joint>
  <link name="tool"><inertial><origin xyz="0 0 0.3"/><mass value="0.5"/>
    <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
  <joint name="flange" type="fixed"><parent link="slider"/><child link="tool"/></joint>
  <transmission name="t"><joint name="shoulder"/></transmission>
</robot>
"""


def test_joints_limits_lumped_links_and_notes():
    robot = parse_robot(ARM, "arm.urdf")
    assert robot.name == "two_arms" and robot.variables == ("q1", "q2", "q3")
    assert robot.joint_names == ("shoulder", "elbow", "slide")
    assert [float(g) for g in robot.gravity] == [0, 0, -9.81]
    shoulder, elbow, slide = robot.links
    assert (shoulder.limits.q, shoulder.limits.dq, shoulder.limits.tau) == ((-1.0, 2.0), 1.5, 30.0)
    assert elbow.limits.q is None and elbow.limits.dq == 3.0 and elbow.limits.tau is None
    assert slide.limits is None and slide.joint == "prismatic"
    assert robot.standard_values["M3"] == 1.5  # the slider with its tool
    assert robot.standard_values["M2"] == 0.0 and len(robot.standard_values) == 30
    assert len(robot.notes) == 1 and "shoulder" in robot.notes[0] and "4e-06 rad" in robot.notes[0]
    assert robot.remarks == robot.notes
    assert convert(ARM.encode(), "arm.urdf", exact=True).robot.notes == ()
    assert parse_robot(ARM.replace("inertial", "visual"), "arm.urdf").standard_values == {}


def test_the_last_link_s_frame_is_the_urdf_s_link_where_the_axis_lets_it():
    """A payload's ten parameters are in this frame: here z along the slide's x, x along its y."""
    conversion = convert(ARM.encode(), "arm.urdf")
    frame = conversion.bodies[-1].frame
    np.testing.assert_allclose(np.array(frame.R, float), [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(np.array(frame.p, float), 0, atol=1e-15)


def test_a_payload_of_a_urdf_is_a_body_on_its_last_link(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    m = generated.load(path, "A", payload="L")
    assert m.joint_names == ("shoulder", "elbow", "slide") and m.prismatic == ("3",)
    assert m.notes == load_robot(path).notes and len(m.notes) == 1
    q, dq, ddq = states(3, 12).reshape(3, 4, 3)
    # 2 kg at (0.1, 0.2, 0.3) of the slider's link, in axes of the frame above: (0.2, 0.3, 0.1)
    point = {"ML": 2.0, "MXL": 0.4, "MYL": 0.6, "MZL": 0.2}
    square = {"XXL": 0.1, "YYL": 0.05, "ZZL": 0.13, "XYL": -0.06, "XZL": -0.02, "YZL": -0.03}
    loaded = {**m.standard_values, **point, **{k: 2 * v for k, v in square.items()}}
    extra = (
        '<link name="load"><inertial><origin xyz="0.1 0.2 0.3"/><mass value="2"/><inertia ixx="0" ixy="0" '
    )
    extra += 'ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link><joint name="grip" type="fixed"><parent '
    extra += 'link="slider"/><child link="load"/></joint></robot>'
    peer = PinocchioUrdf(snapped(ARM.replace("</robot>", extra)), m.joint_names)
    theirs = np.array([peer.torque(*row) for row in zip(q, dq, ddq)])
    ours = m.torque(q, dq, ddq, m.regroup(loaded))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())


def test_numbers_as_they_are_written_wherever_a_urdf_is_read(tmp_path, capsys):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    m = generated.load(path, "A", exact=True)
    assert m.notes == () and generated.load(path, "A").notes  # two models of one file
    q, dq, ddq = states(3, 12).reshape(3, 4, 3)
    peer = PinocchioUrdf(ARM, m.joint_names)
    theirs = np.array([peer.torque(*row) for row in zip(q, dq, ddq)])
    ours = m.torque(q, dq, ddq, m.regroup(m.standard_values))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())
    for more, told in ((["--exact"], False), ([], True)):
        assert run([str(path), "--rules-only", "--model", "A", *more]) == 0
        assert ("exact: true in a study" in capsys.readouterr().err) == told


def test_a_urdf_is_known_by_its_content_too(tmp_path):
    (tmp_path / "robot_description").write_text(ARM)
    assert load_robot(tmp_path / "robot_description").joint_names[0] == "shoulder"
    assert parse_robot("\ufeff" + ARM).n == 3


def test_the_c_of_a_urdf_names_its_joints(tmp_path):
    from modelgen.emit import c_code
    from modelgen.emit.description import derive

    robot = parse_robot(ARM.replace("elbow", "el*/bow"), "arm.urdf")
    derived = derive(robot, "B")
    header = c_code.header(derived, c_code.provenance(robot.source_sha256))
    assert "Joints: q1 shoulder, q2 el_/bow, q3 slide." in header
    assert derived.description["standard_values"]["M3"] == 1.5
