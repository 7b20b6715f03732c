"""sensor_crosstalk: one sensor sees a share of another one's torque."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, first_place, layout, motion, values_of

from modelgen.effects import effect

E = effect("sensor_crosstalk")


def test_columns_are_the_other_sensors_torque():
    model = arm_model(("motor", "sensor"))
    m, place, v = motion(model, 1.0), first_place(E, model, 2, 1), values_of(E)
    expected = np.zeros((len(m.t), 8))
    expected[:, 6] = 0.05 * model.link_torque(m)[:, 1]
    assert contribution(E, place, v, m, model) == pytest.approx(expected, abs=1e-9)
    assert added(model, m, E, place, v) == pytest.approx(expected, abs=1e-9)


def test_places_are_pairs_of_sensors():
    places = list(E.places(layout(arm_model(("motor", "sensor")))))
    assert len(places) == 12 and {p.side for p in places} == {"sensor"}
    assert not list(E.places(layout(arm_model()))) and not list(E.places(layout(arm_model(("drive",)))))


def test_any_sign_may_be_and_spread_is_that_of_draws():
    assert E.physical({"gain": -0.05}) is None
    check_report("sensor_crosstalk")


def test_more_than_the_whole_of_another_torque_is_no_crosstalk():
    """A sensor of five times its scale looked like 4.9 times the torque of another joint (rokae xMate)."""
    assert E.physical({"gain": 4.9}) and E.physical({"gain": -1.1})
    assert E.physical({"gain": 0.2}) is None
