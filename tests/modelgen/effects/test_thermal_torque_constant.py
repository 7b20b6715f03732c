"""thermal_torque_constant: a gain that grows from one and levels off."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, first_place, layout, motion, values_of

from modelgen.effects import effect

E = effect("thermal_torque_constant")


def test_columns_grow_with_the_warming_motor():
    model = arm_model(("motor", "sensor"))
    m, place, v = motion(model, 3.0), first_place(E, model), values_of(E, a=0.1, T=2.0)
    expected = np.zeros((len(m.t), 8))
    expected[:, 1] = 0.1 * (1 - np.exp(-m.t / 2.0)) * model.torque(m)[:, 1]
    assert contribution(E, place, v, m, model) == pytest.approx(expected, abs=1e-9)
    assert added(model, m, E, place, v) == pytest.approx(expected, abs=1e-9)


def test_places_signs_and_spread():
    assert len(list(E.places(layout(arm_model())))) == 4
    assert not list(E.places(layout(arm_model(("drive",)))))
    assert "a would be negative" in E.physical({"a": -0.1, "T": 10.0})
    check_report("thermal_torque_constant")
