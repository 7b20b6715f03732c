"""Contacts, tilted gravity and lagging links against Pinocchio and against finite differences."""

import numpy as np
import pytest

from modelgen.effects import SIGNALS, effect
from modelgen.effects.frames import frames
from modelgen.effects.loads import (
    force_columns,
    gate,
    gravity_columns,
    gravity_torque,
    tilted,
    unit_weights,
)
from modelgen.geometry.robot_file import load_robot

pin = pytest.importorskip("pinocchio")
from pinocchio_robot import PinocchioRobot  # noqa: E402

ROBOTS = ["kuka_lwr4p", "ur10e", "kuka_kr300", "staubli_tx40"]


def some_states(robot, N=12, seed=0):
    return np.random.default_rng(seed).uniform(-3, 3, (N, robot.n))


def some_weights(robot, seed=1):
    rng = np.random.default_rng(seed)
    return {
        (j, kind): float(rng.normal())
        for j in range(1, len(robot.links) + 1)
        for kind in ("M", "MX", "MY", "MZ")
    }


@pytest.mark.parametrize("name", ROBOTS)
def test_gravity_torque_is_pinocchios(name):
    robot = load_robot(name)
    other, weights, q = PinocchioRobot(robot), some_weights(robot), some_states(robot)
    g = np.array([0.3, -0.5, -9.7])
    other.model.gravity = pin.Motion(g, np.zeros(3))
    zero = np.zeros(robot.n)
    expected = np.array([other.torque(row, zero, zero, weights) for row in q])
    got = gravity_torque(robot, q, {f"{kind}{j}": v for (j, kind), v in weights.items()}, g)
    assert got == pytest.approx(expected, abs=1e-11)  # 1e3 N m at 53 bits


@pytest.mark.parametrize("name", ROBOTS)
def test_force_columns_are_pinocchios_jacobian(name):
    robot = load_robot(name)
    other, q = PinocchioRobot(robot), some_states(robot)
    model, data = other.model, other.model.createData()
    for row, got in zip(q, force_columns(robot, q)):
        pin.computeJointJacobians(model, data, row)
        J = pin.getJointJacobian(model, data, model.njoints - 1, pin.LOCAL_WORLD_ALIGNED)
        assert got == pytest.approx(J.T, abs=1e-12)


def test_a_force_does_the_work_of_the_tip():
    """F . dp = tau . dq: the columns against a finite difference of the tip's position."""
    robot = load_robot("kuka_kr300")
    q = some_states(robot, 3)
    columns, h = force_columns(robot, q), 1e-6
    for k in range(robot.n):
        step = h * np.eye(robot.n)[k]
        moved = (frames(robot, q + step).p[:, -1] - frames(robot, q - step).p[:, -1]) / (2 * h)
        assert columns[:, k, :3] == pytest.approx(moved, abs=1e-8)  # h^2 and rounding/h


def test_a_base_that_is_rolled_sees_gravity_turned_back():
    """A base rolled by +90 degrees about x lies on its side: what was up (z) now points along -y."""
    assert tilted(np.array([0, 0, -9.81]), np.pi / 2, 0.0) == pytest.approx([0.0, -9.81, 0.0], abs=1e-12)
    assert tilted(np.array([0, 0, -9.81]), 0.0, np.pi / 2) == pytest.approx([9.81, 0.0, 0.0], abs=1e-12)


def test_only_a_tilt_shows_the_first_moment_of_an_upright_first_link():
    robot = load_robot("kuka_lwr4p")
    q = some_states(robot)
    assert not gravity_columns(robot, q, np.array([0, 0, -9.81]), ("MX1", "MY1")).any()
    seen = gravity_columns(robot, q, np.array([1.0, 0, 0]), ("MX1",))
    assert np.abs(seen[:, 0, 0]).max() > 0.5 and not seen[:, 1:].any()


@pytest.mark.parametrize("name", [*ROBOTS, "scara"])
def test_weights_of_single_parameters_add_up(name):
    robot = load_robot(name)
    q, g = some_states(robot), np.array([0.3, -0.5, -9.7])
    standard = {f"{kind}{j}": v for (j, kind), v in some_weights(robot).items()}
    names, values = tuple(standard), np.array([*standard.values()])
    whole = gravity_torque(robot, q, standard, g)
    assert gravity_columns(robot, q, g, names) @ values == pytest.approx(whole, abs=1e-11)
    assert np.einsum("njka,k,a->nj", unit_weights(robot, q, names), values, g) == pytest.approx(
        whole, abs=1e-11
    )


def test_gate_opens_and_closes():
    t = np.arange(5.0)
    assert gate(t, 1.0, 3.0).tolist() == [0, 1, 1, 0, 0]
    assert gate(t).tolist() == [1] * 5 and gate(t, None, 2.0).tolist() == [1, 1, 0, 0, 0]


def test_payload_of_the_simulator_is_a_body_that_can_exist():
    """Pseudo-inertia positive definite (Wensing et al., RA-L 3(1), 2018) wherever its centre is."""
    e = effect("payload_change")
    rng = np.random.default_rng(0)
    for _ in range(20):
        m, *c = rng.uniform(0.05, 20), *rng.uniform(-0.3, 0.3, 3)
        p, _none = e.values_from_reported({"m": m, **{k: m * x for k, x in zip(("mx", "my", "mz"), c)}})
        inertia = np.array(
            [[p["XX"], p["XY"], p["XZ"]], [p["XY"], p["YY"], p["YZ"]], [p["XZ"], p["YZ"], p["ZZ"]]]
        )
        first = np.array([[p["MX"], p["MY"], p["MZ"]]])
        P = np.block([[np.trace(inertia) / 2 * np.eye(3) - inertia, first.T], [first, np.array([[m]])]])
        assert np.linalg.eigvalsh(P).min() > 0
    assert e.terms["M"] == SIGNALS.gate


def test_a_force_beside_the_origin_adds_its_moment():
    """F at the point p of the frame is F at the origin and the moment (R p) x F."""
    robot = load_robot("staubli_tx40")
    q, point, force = some_states(robot), (0.02, -0.03, 0.08), np.array([3.0, -5.0, 7.0])
    lever = frames(robot, q).R[:, -1] @ np.array(point)
    wrench = np.concatenate([np.tile(force, (len(q), 1)), np.cross(lever, force)], axis=1)
    expected = np.einsum("tnk,tk->tn", force_columns(robot, q), wrench)
    assert force_columns(robot, q, point=point)[:, :, :3] @ force == pytest.approx(expected, abs=1e-12)
