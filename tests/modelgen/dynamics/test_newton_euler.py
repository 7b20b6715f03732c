"""The one Newton-Euler recursion against Pinocchio, the laws of mechanics, and other number types."""

from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from pinocchio_robot import ORDER, PinocchioRobot
from random_robots import robots

from modelgen.dynamics.newton_euler import INERTIAL, regressor, regressor_of_samples, torque
from modelgen.geometry.kinematics import State, geometry, state
from modelgen.geometry.robot_file import built_in_names, load_robot

# Both programs do some hundred operations on numbers of order 1 to 100.
ROUNDING = {"rtol": 1e-10, "atol": 1e-9}


def random_state(robot, seed, samples=None):
    shape = (3, robot.n) if samples is None else (3, samples, robot.n)
    return np.random.default_rng(seed).uniform(-2, 2, shape)


def columns(robot):
    return [(j, kind) for j in range(1, len(robot.links) + 1) for kind in INERTIAL]


def matrix(robot, W):
    """(n, columns) from the recursion's dictionary."""
    return np.column_stack([np.array(W[c], dtype=float) for c in columns(robot)])


def physical_bodies(robot, seed):
    """Parameters of real bodies: a handful of point masses per link."""
    rng = np.random.default_rng(seed)
    result = {}
    for j in range(1, len(robot.links) + 1):
        masses, points = rng.uniform(0.1, 1, 4), rng.uniform(-0.5, 0.5, (4, 3))
        inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
        moments = masses @ points
        values = [inertia[0, 0], inertia[0, 1], inertia[0, 2], inertia[1, 1], inertia[1, 2], inertia[2, 2]]
        values += [*moments, masses.sum()]
        result |= {(j, kind): float(v) for kind, v in zip(INERTIAL, values, strict=True)}
    return result


def check_against_pinocchio(robot, seed):
    q, dq, ddq = random_state(robot, seed)
    independent = PinocchioRobot(robot)
    theirs = independent.regressor(q, dq, ddq)
    ours = regressor(geometry(robot), state(robot, q, dq, ddq), columns(robot))
    for column, tau in theirs.items():
        np.testing.assert_allclose(np.array(ours[column], float), tau, **ROUNDING, err_msg=str(column))
    bodies = physical_bodies(robot, seed)
    tau = torque(geometry(robot), state(robot, q, dq, ddq), bodies)
    np.testing.assert_allclose(np.array(tau, float), independent.torque(q, dq, ddq, bodies), **ROUNDING)


@pytest.mark.parametrize("name", built_in_names())
def test_regressor_and_torque_are_pinocchio_s_on_built_in_robots(name):
    for seed in range(3):
        check_against_pinocchio(load_robot(name), seed)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(robots(), st.integers(0, 999))
def test_regressor_and_torque_are_pinocchio_s_on_random_robots(robot, seed):
    check_against_pinocchio(robot, seed)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(robots(6), st.integers(0, 999))
def test_power_is_the_rate_of_mechanical_energy(robot, seed):
    """dE/dt = dq . tau without friction, E from Pinocchio, its rate by central differences along a motion."""
    q, dq, ddq = random_state(robot, seed)
    bodies = physical_bodies(robot, seed)
    tau = np.array(torque(geometry(robot), state(robot, q, dq, ddq), bodies), float)
    energy, h = PinocchioRobot(robot).mechanical_energy, 1e-5
    after = energy(q + h * dq + h * h / 2 * ddq, dq + h * ddq, bodies)
    before = energy(q - h * dq + h * h / 2 * ddq, dq - h * ddq, bodies)
    # Central differences leave h^2 times third derivatives, and rounding of E divided by h.
    np.testing.assert_allclose((after - before) / (2 * h), dq @ tau, rtol=1e-6, atol=1e-5)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(robots(5), st.integers(0, 999))
def test_torque_is_regressor_times_parameters_exactly(robot, seed):
    """In fractions, with == : twists of right angles, the rest of the geometry rounded to fractions."""
    rng = np.random.default_rng(seed)

    def fraction(x):
        return (
            Fraction(int(rng.integers(-9, 10)), 7) if x is None else Fraction(float(x)).limit_denominator(50)
        )

    g = geometry(robot, fraction)  # not quite a rotation: the identity holds for any numbers
    numbers = [[fraction(None) for _ in range(robot.n)] for _ in range(5)]
    parameters = {c: fraction(None) for c in columns(robot)}
    W = regressor(g, State(*numbers), columns(robot))
    tau = torque(g, State(*numbers), parameters)
    assert [sum(parameters[c] * W[c][i] for c in W) for i in range(robot.n)] == list(tau)


def test_samples_go_through_as_arrays():
    robot = load_robot("ur10e")
    q, dq, ddq = random_state(robot, 3, samples=5)
    W = regressor(geometry(robot), state(robot, q, dq, ddq), columns(robot))
    for k in range(5):
        one = matrix(robot, regressor(geometry(robot), state(robot, q[k], dq[k], ddq[k]), columns(robot)))
        many = np.array([[np.broadcast_to(x, 5)[k] for x in W[c]] for c in columns(robot)]).T
        np.testing.assert_allclose(many, one, rtol=1e-13, atol=1e-13)


def test_symbols_of_sympy_and_casadi_give_the_same_torque():
    robot = load_robot("kuka_lwr4p")
    names = [f"{x}{i}" for x in ("c", "s", "dq", "ddq") for i in range(7)]
    values = np.random.default_rng(0).uniform(-1, 1, 28)
    bodies = physical_bodies(robot, 0)

    def of(make, number=float):
        c, s, dq, ddq = ([make(f"{x}{i}") for i in range(7)] for x in ("c", "s", "dq", "ddq"))
        return torque(geometry(robot, number), State(c, s, [0] * 7, dq, ddq), bodies)

    symbolic = ca.Function("t", [ca.vertcat(*(made := {n: ca.SX.sym(n) for n in names}).values())],
                           [ca.vertcat(*of(made.__getitem__))])  # fmt: skip
    plain = of(dict(zip(names, values, strict=True)).__getitem__)
    np.testing.assert_allclose(np.array(symbolic(values)).ravel(), plain, rtol=1e-12)
    last = of(sp.Symbol)[-1].subs(dict(zip(names, values, strict=True)))
    np.testing.assert_allclose(float(last), plain[-1], rtol=1e-12)


def test_every_intermediate_can_be_named():
    """Bound to fresh symbols and put together again, the torque is the same (as SYMORO writes it)."""
    robot = load_robot("franka_panda")
    q, dq, ddq = random_state(robot, 1)
    values: dict[str, float] = {}

    def name(label, value):
        if isinstance(value, int):
            return value  # structural
        assert label not in values
        values[label] = value
        return values[label]

    bodies = physical_bodies(robot, 0)
    tau = torque(geometry(robot), state(robot, q, dq, ddq), bodies, name)
    assert tau == torque(geometry(robot), state(robot, q, dq, ddq), bodies)
    assert len(values) > 200


def test_the_first_axis_of_an_upright_robot_feels_no_gravity_structurally():
    robot = load_robot("kuka_lwr4p")
    W = regressor(geometry(robot), state(robot, *random_state(robot, 0)), columns(robot))
    assert all(W[1, kind] == (0,) * 7 for kind in ("M", "MZ", "XX", "YY"))
    assert set(ORDER) == set(INERTIAL)


@settings(deadline=None, max_examples=15)
@given(robot=robots(), seed=st.integers(0, 999))
def test_the_columns_of_many_samples_are_those_of_each(robot, seed):
    """All bodies' parameters taken inward together, on random robots, against Pinocchio sample by sample."""
    many = random_state(robot, seed, samples=3)
    W = regressor_of_samples(geometry(robot), state(robot, *many), 3)
    for k in range(3):
        theirs = PinocchioRobot(robot).regressor(*many[:, k])
        for place, column in enumerate(columns(robot)):
            expected = theirs.get(column, np.zeros(len(W)))
            np.testing.assert_allclose(W[:, place, k], expected, **ROUNDING, err_msg=str(column))
