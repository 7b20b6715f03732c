"""Forward kinematics of loads against a two-link arm in closed form and against the generated model."""

import numpy as np
import pytest

import generated
from ident.diagnosis.geometry import Geometry, geometry_of
from modelgen.robot_file import load_robot


def test_force_on_a_planar_arm():
    zeros = np.zeros(3)
    table = np.array([[0, 0, 0, d, 0, 0] for d in (0.0, 0.5, 0.3)], dtype=float)
    arm = Geometry(np.array([0, 0, 2]), np.array([0, 1, 2]), np.array([0, 1, -1]), table, zeros)
    q = np.array([[0.3, -0.8], [1.2, 0.4]])
    J = arm.jacobian_torques(q, 2)
    tip_x = 0.5 * np.cos(q[:, 0]) + 0.3 * np.cos(q.sum(axis=1))
    tip_y = 0.5 * np.sin(q[:, 0]) + 0.3 * np.sin(q.sum(axis=1))
    np.testing.assert_allclose(J[0, :, 0], -tip_y, atol=1e-14)
    np.testing.assert_allclose(J[0, :, 1], tip_x, atol=1e-14)
    np.testing.assert_allclose(J[1, :, 1], 0.3 * np.cos(q.sum(axis=1)), atol=1e-14)


@pytest.mark.parametrize("name", ["ur10e", "franka_panda"])
def test_gravity_torque_is_that_of_the_generated_model(name):
    """The tilt's columns use base parameters as if they were standard ones; along g that changes nothing."""
    model, geometry = generated.load(name, "A"), geometry_of(load_robot(name))
    rng = np.random.default_rng(0)
    q = rng.uniform(-2, 2, (20, model.n))
    row = model.n
    standard = {f"M{row}": 1.3, f"MX{row}": 0.1, f"MY{row}": -0.2, f"MZ{row}": 0.15}
    zero = np.zeros_like(q)
    expected = model.torque(q, zero, zero, model.regroup(standard))
    body = {row - 1: np.array([0.1, -0.2, 0.15, 1.3])}
    got = geometry.gravity_torques(q, body, geometry.gravity)
    np.testing.assert_allclose(got.T, expected, atol=1e-10)
