"""Written robots have the geometry that was meant: Pinocchio and MuJoCo read the files."""

from types import SimpleNamespace

import numpy as np
import pytest
from random_robots import random_robot

from ident.export.bodies import body, given_bodies, pseudo
from ident.export.mjcf import write_mjcf
from ident.export.urdf import write_urdf
from ident.export.urdf_template import fill_urdf
from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.geometry.urdf import convert

pin = pytest.importorskip("pinocchio")
from pinocchio_robot import PinocchioRobot  # noqa: E402

pytestmark = pytest.mark.unexamined

SEEDS = range(40)
ARM = b"""<robot name="arm">
  <link name="base"><inertial><mass value="3"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.1 0.02 0.2" rpy="0.1 0.2 0.3"/><mass value="2"/>
    <inertia ixx="0.03" ixy="0.001" ixz="0.002" iyy="0.04" iyz="-0.003" izz="0.05"/></inertial>
    <visual><geometry><box size="1 1 1"/></geometry></visual><!-- by hand -->
    <drake:proximity><drake:mu value="1 &amp; 2"/></drake:proximity></link>
  <link name="lid"><inertial><origin xyz="0 0.1 0"/><mass value="0.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="lower"><inertial><mass value="1"/><origin xyz="0.2 0 0"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 0.6 0.8"/>
    <limit lower="-2" upper="2" effort="50" velocity="3"/><dynamics damping="9"/></joint>
  <joint name="glue" type="fixed"><parent link="upper"/><child link="lid"/>
    <origin xyz="0.1 0 0" rpy="0 0.5 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.3 0 0" rpy="1 0 0"/><axis xyz="0 -1 0"/></joint>
</robot>"""


def random_bodies(count, seed=0):
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(count, 4, 4)) * 0.4
    return np.array([body(A @ A.T + 0.01 * np.eye(4)) for A in roots])


def robot_with(phi):
    """What the writers ask of a Consistent: bodies without drives."""
    names = SimpleNamespace(names=(), solid=np.ones(len(phi), bool), links=len(phi))
    return SimpleNamespace(bodies=lambda: phi, combination=names, value=lambda name: 0.0)


def by_row(phi):
    return {(j + 1, kind): phi[j, k] for j in range(len(phi)) for k, kind in enumerate(INERTIAL)}


@pytest.mark.parametrize("seed", SEEDS)
def test_urdf_of_any_table(seed):
    robot = random_robot(seed)
    phi = random_bodies(len(robot.links), seed)
    model = pin.buildModelFromXML(write_urdf(robot, robot_with(phi), "random"))
    size = np.linalg.norm([float(g) for g in robot.gravity])
    model.gravity.linear = np.array([0, 0, -size])  # a URDF has none of its own
    order = [model.joints[model.getJointId(name)].idx_q for name in robot.variables]
    truth, data = PinocchioRobot(robot), model.createData()
    for state in np.random.default_rng(seed).uniform(-2, 2, (5, 3, robot.n)):
        moved = np.zeros((3, robot.n))
        moved[:, order] = state
        tau = pin.rnea(model, data, *moved)[order]
        expected = truth.torque(*state, by_row(phi))
        np.testing.assert_allclose(tau, expected, atol=1e-11 * max(np.abs(expected).max(), 1))


@pytest.mark.parametrize("seed", SEEDS)
def test_mjcf_of_any_table(seed):
    mujoco = pytest.importorskip("mujoco")
    robot = random_robot(seed)
    phi = random_bodies(len(robot.links), seed)
    model = mujoco.MjModel.from_xml_string(write_mjcf(robot, robot_with(phi), "random"))
    data = mujoco.MjData(model)
    order = [model.joint(name).qposadr[0] for name in robot.variables]
    truth = PinocchioRobot(robot)
    for state in np.random.default_rng(seed).uniform(-2, 2, (5, 3, robot.n)):
        for target, values in zip((data.qpos, data.qvel, data.qacc), state):
            target[order] = values
        mujoco.mj_inverse(model, data)
        expected = truth.torque(*state, by_row(phi))
        np.testing.assert_allclose(
            data.qfrc_inverse[order], expected, atol=1e-10 * max(np.abs(expected).max(), 1)
        )


def test_a_urdf_filled_with_its_own_bodies_is_itself():
    robot = convert(ARM, "arm.urdf").robot
    phi = np.array([body(P) for P in given_bodies(robot)])
    text = fill_urdf(ARM, "arm.urdf", robot_with(phi), "identified")
    assert "<visual>" in text and "identified" in text and text.count("<inertial>") == 3  # the lid's went up
    assert 'damping="9"' not in text
    assert "<!-- by hand -->" in text and '<drake:mu value="1 &amp; 2" />' in text  # a prefix nobody declared
    before, after = pin.buildModelFromXML(ARM.decode()), pin.buildModelFromXML(text)
    for state in np.random.default_rng(1).uniform(-2, 2, (5, 3, 2)):
        q = np.array([state[0, 0], np.cos(state[0, 1]), np.sin(state[0, 1])])
        torques = [pin.rnea(m, m.createData(), q, *state[1:]) for m in (before, after)]
        np.testing.assert_allclose(*torques, atol=1e-12)


def test_pseudo_inertias_turn_back_into_parameters():
    phi = random_bodies(3)
    np.testing.assert_allclose([body(pseudo(row)) for row in phi], phi, rtol=1e-13)


@pytest.mark.parametrize(("delay", "late"), [(-0.0065, "motor"), (0.0045, "sensor")])
def test_a_delay_is_the_motor_s_or_the_sensor_s(delay, late):
    """A ramp of commands through MuJoCo: force and measurement come as much later as the file says."""
    mujoco = pytest.importorskip("mujoco")
    robot = random_robot(0)
    phi = random_bodies(len(robot.links))
    model = mujoco.MjModel.from_xml_string(write_mjcf(robot, robot_with(phi), "late", {1: delay}))
    data, step = mujoco.MjData(model), model.opt.timestep
    force, measured = [], []
    for k in range(40):
        data.ctrl[:] = k * step
        mujoco.mj_step(model, data)
        force.append(data.actuator_force.copy())
        measured.append(data.sensordata.copy())
    now = step * np.arange(40)
    behind = np.array([delay if late == "motor" and j == 1 else 0.0 for j in range(robot.n)])
    np.testing.assert_allclose(np.array(force)[20:], (now[:, None] + behind)[20:], atol=1e-12)
    if late == "sensor":
        np.testing.assert_allclose(np.array(measured)[20:, 0], (now - delay)[20:], atol=1e-12)
