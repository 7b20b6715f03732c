"""The simulated loop against Pinocchio's forward dynamics, the balance of energy and a formula."""

import numpy as np
import pytest

import generated
from ident.twin.closed_loop import Gains, LoopError, Motion, Plant, follow


def plant(robot="ur5e", width=0.05, **friction):
    """A UR5e with the inertias of its URDF and some friction, and Pinocchio's model of it."""
    model = generated.load(robot, "A")
    chi = model.regroup(dict(model.standard_values) | friction)
    return model, Plant(lambda q, dq, ddq, sign: model.torque(q, dq, ddq, chi, sign=sign), np.full(6, width))


def swing(seconds=2.0, rate=500.0, n=6, size=0.3):
    t = np.arange(round(seconds * rate) + 1) / rate
    w = 2 * np.pi * np.arange(1, n + 1) / seconds / 2
    q = size * (1 - np.cos(w * t[:, None])) / 2
    return Motion(t, q, size * w * np.sin(w * t[:, None]) / 2, size * w**2 * np.cos(w * t[:, None]) / 2)


def test_acceleration_is_pinocchios_aba():
    pin = pytest.importorskip("pinocchio")
    from importlib.resources import files

    from modelgen.geometry.robot_file import load_robot  # noqa: F401  the built-in URDF

    twin = pin.buildModelFromUrdf(str(files("modelgen").joinpath("robots", "ur5e.urdf")))
    data, (_, its) = twin.createData(), plant()
    rng = np.random.default_rng(1)
    for _ in range(5):
        q, dq, tau = rng.uniform(-2, 2, 6), rng.uniform(-1, 1, 6), rng.uniform(-40, 40, 6)
        theirs = pin.aba(twin, data, q, dq, tau)
        ours = its.acceleration(q[None], dq[None], tau[None])
        assert np.abs(ours - theirs).max() < 1e-6 * np.abs(theirs).max()


def test_energy_that_the_motors_give_is_kinetic_potential_or_friction():
    model, its = plant(**{f"Fvm{j}": 2.0 for j in range(1, 7)})
    reference = swing()
    gains = Gains.of_bandwidth(its.inertia(reference.q), np.full(6, 6.0), 1.0)
    done, u = follow(its, gains, reference)
    still = model.torque(done.q, 0 * done.q, 0 * done.q, model.regroup(model.standard_values))  # gravity
    kinetic = [0.5 * dq @ its.mass_and_rest(q, dq)[0] @ dq for q, dq in zip(done.q, done.dq)]

    def work(force):
        return np.sum(0.5 * (force[1:] * done.dq[1:] + force[:-1] * done.dq[:-1])) * (done.t[1] - done.t[0])

    given = work(u)
    kept = kinetic[-1] - kinetic[0] + work(still) + work(2.0 * done.dq)
    assert given == pytest.approx(kept, abs=2e-3 * work(np.abs(u) * np.sign(done.dq)))


def test_a_linear_loop_is_that_of_its_formula_and_a_wild_one_is_refused():
    def mass(q, dq, ddq, sign):
        return 2.0 * ddq

    w, n = 2 * np.pi * 3.0, 2
    its = Plant(mass, np.full(n, 1.0))
    t = np.arange(2001) / 1000
    step = Motion(t, np.ones((len(t), n)) * (t > 0)[:, None], np.zeros((len(t), n)), np.zeros((len(t), n)))
    gains = Gains.of_bandwidth(its.inertia(step.q), np.full(n, 3.0), 1.0)
    assert np.allclose(gains.kp, 2 * w**2)
    done, _ = follow(its, gains, step)
    assert np.abs(done.q[:, 0] - (1 - (1 + w * t) * np.exp(-w * t))).max() < 5e-3
    middle = done.at(np.array([0.4005]))[0][0, 0]
    assert middle == pytest.approx(1 - (1 + w * 0.4005) * np.exp(-w * 0.4005), abs=5e-3)
    wild = Gains(-gains.kp, gains.kd, gains.ki)
    with pytest.raises(LoopError, match="does not follow its reference"):
        follow(its, wild, step)
    with pytest.raises(LoopError, match="not positive"):
        Plant(lambda q, dq, ddq, sign: -ddq, np.ones(n)).inertia(step.q)
