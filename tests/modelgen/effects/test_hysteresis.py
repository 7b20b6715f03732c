"""hysteresis: Dahl's friction instead of the sign; blocks go on where the last one ended."""

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
    split_agrees,
    values_of,
)

from modelgen.effects import effect

E = effect("hysteresis")


def dahl(q, Fc, sigma):
    """Small steps of dF = sigma (1 - F/Fc sign dq) dq, the differential equation itself."""
    F = np.zeros(len(q))
    for k in range(1, len(q)):
        step, value = (q[k] - q[k - 1]) / 20, F[k - 1]
        for _ in range(20):
            value += sigma * (1 - value / Fc * np.sign(step)) * step
        F[k] = value
    return F


def test_columns_are_dahls_friction_less_the_sign():
    model = arm_model(dry=False)
    m, place, v = motion(model, 2.0), first_place(E, model), values_of(E)
    expected = dahl(m.q[:, 1], 6.0, 150.0) - 6.0 * np.sign(m.dq[:, 1])
    seen = contribution(E, place, v, m, model)
    assert seen[:, 1] == pytest.approx(expected, abs=0.02 * 6.0)
    assert added(model, m, E, place, v) == pytest.approx(seen, abs=1e-9)


def test_blocks_places_signs_and_spread():
    model = arm_model(dry=False)
    assert split_agrees(E, first_place(E, model), values_of(E), motion(model, 2.0), model) < 1e-9
    assert [p.side for p in E.places(layout(arm_model(("motor", "sensor"))))] == ["motor"] * 4 + ["link"] * 4
    assert "width would be negative" in E.physical({"Fc": 1.0, "width": -1.0})
    assert E.usual({}, {"Fc": 12.0}) == {"sigma": 300.0, "Fc": 12.0}
    check_report("hysteresis")
