"""current_saturation: what is above the limit is missing, and nothing below it."""

from dataclasses import replace

import numpy as np
import pytest
from effect_model import (
    added,
    arm_model,
    check_report,
    contribution,
    first_place,
    layout,
    motion,
    recorded,
    simulated,
    values_of,
)

from modelgen.effects import effect

E = effect("current_saturation")


def test_columns_are_the_clipped_tops():
    model = arm_model(("motor", "sensor"))
    m, place = motion(model, 3.0), first_place(E, model)
    tau = model.torque(m)[:, 1]
    top = 0.7 * np.abs(tau).max()
    v = values_of(E, limit=top)
    expected = np.zeros((len(m.t), 8))
    expected[:, 1] = np.where(np.abs(tau) > top, top * np.sign(tau) - tau, 0.0)
    assert expected.any() and contribution(E, place, v, m, model) == pytest.approx(expected, abs=1e-9)
    assert added(model, m, E, place, v) == pytest.approx(expected, abs=1e-9)


def test_it_starts_at_the_largest_recorded_torque():
    model = arm_model()
    m, place = motion(model, 3.0), first_place(E, model)
    top = 0.7 * np.abs(model.torque(m)[:, 1]).max()
    tau = recorded(model, simulated(model, m, E, place, values_of(E, limit=top)))
    assert E.starts(place, [replace(m, measured=tau)], [], model)[0]["limit"] == pytest.approx(top)


def test_places_signs_and_spread():
    assert len(list(E.places(layout(arm_model())))) == 4
    assert "limit would be negative" in E.physical({"share": 1.0, "limit": -1.0})
    assert "recorded than is missing" in E.physical({"share": 0.17, "limit": 0.3})  # of a cubic scale
    assert E.physical({"share": 0.9, "limit": 0.3}) is None
    check_report("current_saturation")
