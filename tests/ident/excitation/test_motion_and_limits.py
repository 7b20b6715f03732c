"""Motions are at rest where they begin, periodic, inside limits at every instant; refusals name the limit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ident.excitation.holding import Holding
from ident.excitation.limits import ExcitationError, bounds_of
from ident.excitation.motion import Basis, FourierMotion
from ident.excitation.optimal import optimise, random_motion
from modelgen.geometry.robot_file import parse_robot

PLANAR = b"""
name: planar
convention: mdh
gravity: [0, -9.81, 0]
links:
  - {joint: revolute, antecedent: 0, alpha: 0, d: 0, theta: q1, r: 0,
     limits: {q: [-2, 1], dq: 2, ddq: 6, tau: 40}}
  - {joint: revolute, antecedent: 1, alpha: 0, d: 0.5, theta: q2, r: 0,
     limits: {q: [-1, 2], dq: 3, ddq: 9, tau: 15}}
"""


def test_at_rest_where_it_begins_and_periodic():
    basis = Basis(10.0, 6)
    motion = FourierMotion(basis, np.random.default_rng(0).normal(size=(3, basis.size)), 20.0)
    for t in (0.0, 10.0, 20.0):
        q, dq, ddq, _ = motion.states(np.array([t]))
        np.testing.assert_allclose(q[0], motion.x[:, 0], atol=1e-12)
        np.testing.assert_allclose([dq, ddq], 0, atol=1e-10)  # round-off of sums of ten ones


def test_derivatives_are_those_of_the_positions():
    basis = Basis(7.0, 5)
    motion = FourierMotion(basis, np.random.default_rng(1).normal(size=(2, basis.size)), 7.0)
    t = np.linspace(0.3, 6.0, 50)
    up, down, here = (motion.states(t + h) for h in (1e-5, -1e-5, 0.0))
    for k in range(3):  # central differences: h^2 of the third derivative
        np.testing.assert_allclose((up[k] - down[k]) / 2e-5, here[k + 1], atol=1e-5)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(3, 12))
def test_what_holds_on_the_grid_holds_everywhere(seed, harmonics):
    basis = Basis(10.0, harmonics)
    x = np.random.default_rng(seed).normal(size=basis.size)
    fine = basis.at(np.linspace(0, 10, 4000))
    for times in (1, 4):
        for coarse, dense in zip(basis.at(basis.finer(times)), fine):
            assert np.abs(dense @ x).max() <= np.abs(coarse @ x).max() / basis.tighter(times) * (1 + 1e-12)


@pytest.fixture(scope="module")
def planar(tmp_path_factory):
    import generated

    file = tmp_path_factory.mktemp("planar") / "planar.yaml"
    file.write_bytes(PLANAR)
    model = generated.load(str(file), "A")
    chi = np.abs(np.random.default_rng(2).normal(size=len(model.parameters))) * 0.8
    return parse_robot(PLANAR, "planar.yaml"), model, chi


@pytest.mark.long
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.3, 1.0), st.floats(0.2, 1.0))
def test_designs_hold_their_limits_at_every_sample(planar, seed, fast, strong):
    robot, model, chi = planar
    bounds = bounds_of(robot, [f"dq={2 * fast}", "jerk=40", f"tau:1={40 * strong + 5}"])
    dry = np.array([0.5, 0.2])
    friction = np.array([k for k, name in enumerate(model.parameters) if name.startswith("Fc")])
    chi = chi.copy()
    chi[friction] = dry
    holding, basis = Holding(bounds, model, chi, dry), Basis(6.0, 4)
    aim = np.random.default_rng(seed).normal(size=(2, basis.size))
    try:
        best = optimise(
            holding,
            basis,
            6.0,
            lambda x: (float((aim * x).sum()), lambda: aim),
            seed=seed,
            starts=1,
            iterations=15,
        )
    except ExcitationError as error:
        assert "tau of joint" in str(error)  # gravity alone is too much
        return
    q, dq, ddq, jerk = best.motion.states(np.arange(0, 6, 1e-3))
    tau = model.torque(q, dq, ddq, chi)  # with the sign of the rate, which the design bounds from both sides
    assert np.all((bounds.low - 1e-9 <= q) & (q <= bounds.high + 1e-9))
    for values, limit in ((dq, bounds.dq), (ddq, bounds.ddq), (jerk, bounds.jerk), (tau, bounds.tau)):
        assert np.all(np.abs(values) <= limit * (1 + 1e-9))


def test_the_optimum_is_better_than_random_motions(planar):
    robot, model, chi = planar
    holding, basis = Holding(bounds_of(robot), model, chi, np.zeros(2)), Basis(6.0, 4)
    B = basis.at(basis.grid)[1]

    def swing(x):  # how much joint 1 moves, a convex function to be made large
        return -float(np.sum((B @ x[0]) ** 2)), lambda: np.stack([-2 * B.T @ (B @ x[0]), 0 * x[1]])

    rng = np.random.default_rng(3)
    rest = holding.rest(None, rng)
    drawn = [random_motion(holding, basis, rest, 6.0, rng, False) for _ in range(100)]
    best = optimise(holding, basis, 6.0, swing, starts=2, iterations=40)
    assert best.value < min(swing(motion.x)[0] for motion in drawn)


@pytest.mark.parametrize("inside", [0.5, 0.03, 0.002])
def test_a_start_next_to_a_limit_binds_its_own_joint_alone(planar, inside):
    """In the outer twentieth of its range it was beyond limits that are tighter on the grid: no search held
    them, and all joints were drawn to rest (of an LWR4+ a condition number of 3,530 became 11)."""
    robot, model, chi = planar
    holding, basis = Holding(bounds_of(robot), model, chi, np.zeros(2)), Basis(6.0, 4)
    B = basis.at(basis.grid)[1]

    def swing(x):  # how much both joints move
        return -float(np.sum((B @ x.T) ** 2)), lambda: -2 * (x @ B.T) @ B

    start = np.array([1.0 - inside, 0.5])
    best = optimise(holding, basis, 6.0, swing, start=start, starts=1, iterations=40)
    q = best.motion.states(np.arange(0, 6, 1e-3))[0]
    assert holding.use(best.motion)[0] <= 1 and q[0] == pytest.approx(start)
    assert np.all(np.ptp(q, axis=0) > 1.0)


def test_a_start_at_the_end_of_a_range_is_refused():
    bounds = bounds_of(parse_robot(PLANAR, "planar.yaml"))
    bounds.check_room(10.0, np.array([0.99, -0.9]))
    with pytest.raises(ExcitationError, match="joint 1, -2 to 1 rad, and leaves no way to either side"):
        bounds.check_room(10.0, np.array([1.0, 0.0]))


def test_a_stopped_search_gives_the_best_so_far(planar):
    robot, model, chi = planar
    holding, basis = Holding(bounds_of(robot), model, chi, np.zeros(2)), Basis(6.0, 4)
    best = optimise(holding, basis, 6.0, lambda x: (x.sum(), lambda: np.ones_like(x)), stop=lambda: True)
    assert best.stopped and holding.use(best.motion)[0] <= 1


@pytest.mark.parametrize(
    ("option", "told"),
    [
        ("dq=0", "may not move"),
        ("speed=1", "KEY"),
        ("dq:7=1", "no joint 7"),
        ("q=1", "low..high"),
        ("q=1..-1", "swap"),
        ("tau=nan", "one number"),
    ],
)
def test_wrong_limits_are_told(option, told):
    with pytest.raises(ExcitationError, match=told):
        bounds_of(parse_robot(PLANAR, "planar.yaml"), [option])


def test_a_start_outside_its_limits_and_gravity_beyond_the_torque_are_named(planar):
    robot, model, chi = planar
    rng = np.random.default_rng(0)
    holding = Holding(bounds_of(robot), model, chi, np.zeros(2))
    with pytest.raises(ExcitationError, match="the start is forbidden by q of joint 1, -2 to 1 rad"):
        holding.rest(np.array([1.5, 0.0]), rng)
    weak = Holding(bounds_of(robot, ["tau=0.1"]), model, chi, np.array([0.2, 0.0]))
    with pytest.raises(ExcitationError, match="tau of joint 1, at most"):
        weak.rest(None, rng)
