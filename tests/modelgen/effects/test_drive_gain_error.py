"""drive_gain_error: the recorded torque is gain times the one that acts."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, first_place, layout, motion, values_of

from modelgen.effects import effect

E = effect("drive_gain_error")


@pytest.mark.parametrize("side, row", [("motor", 1), ("sensor", 5)])
def test_columns_are_the_torque_and_the_simulator_scales_it(side, row):
    model = arm_model(("motor", "sensor"))
    m = motion(model, 1.0)
    place = next(p for p in E.places(layout(model)) if p.side == side and p.joint == 1)
    v = values_of(E, gain=1.08)
    expected = np.zeros((len(m.t), 8))
    expected[:, row] = 0.08 * model.torque(m)[:, row]
    assert contribution(E, place, v, m, model) == pytest.approx(expected, abs=1e-9)
    assert added(model, m, E, place, v) == pytest.approx(expected, abs=1e-9)


def test_found_effects_are_scaled_with_the_torque():
    model = arm_model()
    m = motion(model, 0.5)
    with_found = type(model)(model.robot, model.channels, model.standard, np.ones((len(m.t), 4)))
    column = E.columns(first_place(E, model), {}, None, m, with_found)[1]
    assert column[:, 0] == pytest.approx(model.torque(m)[:, 1] + 1.0)


def test_a_difference_does_not_show_whose_gain_it_is():
    assert not list(E.places(layout(arm_model(("drive",)))))
    assert len(list(E.places(layout(arm_model())))) == 4


def test_it_is_told_as_a_gain():
    told = E.report({"excess": 0.08}, np.array([[1e-4]]))["gain"]
    assert told == {"value": 1.08, "std": pytest.approx(0.01), "unit": "-"}
    assert E.physical({"excess": -0.2}) is None
    check_report("drive_gain_error")
