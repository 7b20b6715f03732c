"""The first joint's zero and the base's mounting are one thing, and are told as one."""

from dataclasses import replace

import numpy as np
import pytest
from planted import ON_RECORDINGS, measured

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.bodies import torques
from ident.examination.fits.first_axis import FirstAxis
from modelgen.geometry.kinematics import geometry
from modelgen.geometry.robot_file import load_robot

MOTORS = tuple(f"tau_m{j}" for j in range(1, 8))


@pytest.mark.parametrize("robot", ["kuka_lwr4p", "staubli_tx40"])
def test_another_zero_is_another_gravity(robot):
    """By Newton and Euler: tau(q1 + x, g) = tau(q1, g turned by -x about the first axis)."""
    table = geometry(load_robot(robot))
    table = replace(table, rows=(replace(table.rows[0], c_alpha=0, s_alpha=-1), *table.rows[1:]))
    rng = np.random.default_rng(0)
    table = replace(table, gravity=tuple(rng.normal(size=3)))
    n = len(table.moving)
    q, dq, ddq = rng.normal(size=(3, 20, n))
    bodies = rng.normal(size=10 * len(table.rows))
    first = FirstAxis.of(table, range(1, n + 1))
    assert first is not None and first.name == "q1"
    turned = replace(table, gravity=tuple(first.turned(table.gravity, 0.7)))
    other = torques(table, q + 0.7 * (np.arange(n) == 0), dq, ddq, bodies)
    assert np.allclose(other, torques(turned, q, dq, ddq, bodies), atol=1e-9)
    said = first.zero_of(np.array(table.gravity), np.array(turned.gravity), 1.0)
    assert said == ", or q1 starts from another zero, about -0.7 rad off"
    assert not first.zero_of(np.array(table.gravity), -np.array(table.gravity), 1.0)


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.long
@pytest.mark.parametrize(("robot", "zero"), [("dualarm_v2_7dof", True), ("airbot_play", False)])
def test_an_arm_told_to_be_on_a_wall(robot, zero):
    """Of the dual arm, whose first axis lies, a zero of q1 of 1.6 rad was told and no other gravity."""
    dead = {} if robot == "airbot_play" else {"channels": tuple(f"tau_l{j}" for j in range(1, 5)) + MOTORS}
    checks = examine_fit(prepare_study(measured(robot).with_(gravity=(9.81, 0, 0), **dead)))
    (said,) = [c for c in checks if c.check == "base_orientation"]
    assert said.remedy.split("  #")[0] == "gravity: [0, 0, -9.81]"
    assert ("q1 starts from another zero" in said.message) == zero


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_one_run_of_an_arm_told_to_be_on_a_wall():
    """A base was told that is turned by 60 degrees, not 90, within 9: nothing else was sought."""
    channels = tuple(f"tau_l{j}" for j in range(1, 5)) + MOTORS
    study = measured("dualarm_v2_7dof").with_(gravity=(9.81, 0, 0), channels=channels)
    run = tuple(r for r in study.recordings if r.file.startswith("identify_a"))
    checks = examine_fit(prepare_study(study.with_(recordings=run)))
    (said,) = [c for c in checks if c.check == "base_orientation"]
    assert said.remedy.split("  #")[0] == "gravity: [0, 0, -9.81]"
    assert "q1 starts from another zero" in said.message
