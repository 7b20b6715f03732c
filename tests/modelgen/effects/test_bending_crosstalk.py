"""bending_crosstalk: the moment across the sensor's axis, against Pinocchio's joint wrenches."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, first_place, layout, motion, values_of

from modelgen.effects import effect
from modelgen.effects.loads import joint_moments
from modelgen.geometry.robot_file import load_robot

E = effect("bending_crosstalk")


@pytest.mark.parametrize("name", ["ur10e", "kuka_lwr4p"])
def test_the_moment_is_pinocchios(name):
    pin = pytest.importorskip("pinocchio")
    from pinocchio_robot import PinocchioRobot

    robot = load_robot(name)
    rng = np.random.default_rng(0)
    kinds = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
    weights = {(j, kind): float(rng.normal()) for j in range(1, robot.n + 1) for kind in kinds}
    standard = {f"{kind}{j}": value for (j, kind), value in weights.items()}
    other = PinocchioRobot(robot)
    q, dq, ddq = rng.normal(size=(3, 4, robot.n))
    for k in range(4):
        torque = other.torque(q[k], dq[k], ddq[k], weights)
        for row in range(1, robot.n + 1):
            n = joint_moments(robot, q[[k]], dq[[k]], ddq[[k]], standard, row)[0]
            assert n[2] == pytest.approx(torque[row - 1], abs=1e-9)
    assert pin is not None


def test_the_moment_at_rest_is_weight_times_lever():
    """One body: n = ms x (-g) in its own frame, whatever carries it."""
    model = arm_model()
    m = motion(model, 0.2)
    rest = np.zeros_like(m.q)
    only = {k: v for k, v in model.bodies().items() if k.endswith("4")}
    n = joint_moments(model.robot, m.q, rest, rest, only, 4)
    from modelgen.effects.frames import frames

    R = frames(model.robot, m.q).R[:, 3]
    up = np.einsum("nij,i->nj", R, np.array([0, 0, 9.81]))
    ms = np.array([only["MX4"], only["MY4"], only["MZ4"]])
    assert n == pytest.approx(np.cross(ms, up), abs=1e-9)


def test_columns_are_what_the_simulated_sensor_reads():
    model = arm_model(("motor", "sensor"))
    m, place, v = motion(model, 1.0), first_place(E, model), values_of(E)
    seen = contribution(E, place, v, m, model)
    assert seen[:, 5].any() and not np.delete(seen, 5, axis=1).any()
    assert added(model, m, E, place, v) == pytest.approx(seen, abs=1e-9)


def test_places_are_sensors_and_spread_is_that_of_draws():
    assert [p.joint for p in E.places(layout(arm_model(("motor", "sensor"))))] == [0, 1, 2, 3]
    assert not list(E.places(layout(arm_model())))
    assert E.physical(values_of(E)) is None
    check_report("bending_crosstalk")
