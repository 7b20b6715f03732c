"""torque_share: the motors of coupled joints carry a part of each other's torque."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, first_place, layout, motion, values_of

from modelgen.effects import effect

E = effect("torque_share")


def test_columns_are_the_other_motors_torque():
    model = arm_model(("motor", "sensor"))
    m, place, v = motion(model, 1.0), first_place(E, model, 2, 1), values_of(E)
    expected = np.zeros((len(m.t), 8))
    expected[:, 2] = 0.3 * model.total(m)[:, 1]
    assert contribution(E, place, v, m, model) == pytest.approx(expected, abs=1e-9)
    assert added(model, m, E, place, v) == pytest.approx(expected, abs=1e-9)


def test_motors_of_links_that_turn_together_share_their_power():
    """With q = C theta the power of all torques is that of the motors': tau_motor = C^T tau."""
    model = arm_model()
    m, place = motion(model, 1.0), first_place(E, model, 2, 1)
    C = np.eye(4)
    C[1, 2] = 0.3  # the third motor turns the second joint, too
    theta_rate = m.dq @ np.linalg.inv(C).T
    tau = model.total(m)
    motors = tau + contribution(E, place, {"gain": 0.3}, m, model)
    assert np.sum(motors * theta_rate, axis=1) == pytest.approx(np.sum(tau * m.dq, axis=1), abs=1e-9)


def test_places_are_pairs_of_motors():
    places = list(E.places(layout(arm_model(("motor", "sensor")))))
    assert len(places) == 12 and {p.side for p in places} == {"motor"}
    assert not list(E.places(layout(arm_model(("sensor",))))) and not list(
        E.places(layout(arm_model(("drive",))))
    )


def test_any_sign_may_be_and_spread_is_that_of_draws():
    assert E.physical({"gain": -1.0}) is None
    check_report("torque_share")
