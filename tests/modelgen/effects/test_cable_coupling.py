"""cable_coupling: the torques are the gradient of an energy of both positions."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, layout, motion, values_of

from modelgen.effects import effect
from modelgen.effects.effect import Place

E = effect("cable_coupling")


def test_columns_are_the_gradient_of_the_energy():
    model = arm_model(("motor", "sensor"), dry=False)
    m, v = motion(model, 1.0), values_of(E)
    place = Place(2, 1, "link", parts=("k_cross", "k_own", "k_source"))

    def energy(q):
        return (
            v["k_own"] * q[:, 2] ** 2 / 2
            + v["k_cross"] * q[:, 2] * q[:, 1]
            + v["k_source"] * q[:, 1] ** 2 / 2
        )

    h, expected = 1e-4, np.zeros((len(m.t), 8))
    for k in (1, 2):
        step = h * np.eye(4)[k]
        slope = (energy(m.q + step) - energy(m.q - step)) / (2 * h)
        expected[:, k] = expected[:, k + 4] = slope
    assert contribution(E, place, v, m, model) == pytest.approx(expected, abs=1e-8)
    assert added(model, m, E, place, v) == pytest.approx(expected, abs=1e-8)


def test_each_pair_of_joints_is_a_place_once():
    places = list(E.places(layout(arm_model())))
    pairs = {(p.joint, p.source) for p in places}
    assert pairs == {(j, s) for j in range(4) for s in range(j)} and len(places) == 12
    assert not list(E.places(layout(arm_model(("drive",)))))


def test_it_stores_energy_whichever_way_it_is_stretched():
    place, model = Place(2, 1, "link", parts=("k_cross", "k_own", "k_source")), arm_model()
    assert E.beyond(values_of(E), np.eye(3), place, model.robot) == 0.0
    values = {"k_cross": 9.0, "k_own": 5.0, "k_source": 5.0}
    assert E.beyond(values, 1e-2 * np.eye(3), place, model.robot) == pytest.approx(56 / 0.1 / np.sqrt(374))
    alone = Place(2, 1, "link", parts=("k_cross",))
    assert E.beyond({"k_cross": -9.0}, np.eye(1), alone, model.robot) == 0.0
    check_report("cable_coupling")


def test_noise_puts_one_cable_beyond_by_a_normal_number():
    """Stretched by q - r q_source: k_own k_source = k_cross^2, and the deviation of the difference is one."""
    place, model, g = (
        Place(2, 1, "link", parts=("k_cross", "k_own", "k_source")),
        arm_model(),
        np.random.default_rng(4),
    )
    a = g.normal(size=(3, 3))
    covariance = 1e-4 * (a @ a.T + 0.1 * np.eye(3))
    drawn = g.multivariate_normal([-2.1, 3.0, 1.47], covariance, 4000)
    told = np.array([E.beyond(dict(zip(place.parts, x)), covariance, place, model.robot) for x in drawn])
    assert np.mean(told > 0) == pytest.approx(0.5, abs=0.04)
    assert np.mean(told > 1.96) == pytest.approx(0.025, abs=0.01)
