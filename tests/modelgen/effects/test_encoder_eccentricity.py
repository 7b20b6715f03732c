"""encoder_eccentricity: torques at the true position against the model at the recorded one."""

import numpy as np
import pytest
from effect_model import (
    SLIDE,
    arm_model,
    as_recorded_by,
    check_report,
    contribution,
    first_place,
    layout,
    motion,
    values_of,
)

from modelgen.effects import effect

E = effect("encoder_eccentricity")


def test_columns_are_what_a_wrong_position_leaves():
    model = arm_model(("motor", "sensor"), dry=False)
    m, place, v = motion(model, 2.0, rate=4000.0), first_place(E, model), values_of(E, e=1e-4)
    seen, left = as_recorded_by(E, model, m, place, v)
    assert (seen.q - m.q)[:, 1] == pytest.approx(1e-4 * np.sin(m.q[:, 1] + 0.6), abs=1e-12)
    inner = slice(20, -20)
    assert contribution(E, place, v, seen, model)[inner] == pytest.approx(
        left[inner], abs=2e-3 * np.abs(left[inner]).max()
    )


def test_only_joints_that_turn_have_a_disc():
    assert [p.joint for p in E.places(layout(arm_model(text=SLIDE)))] == [0]
    assert len(list(E.places(layout(arm_model())))) == 4


def test_spread_is_that_of_draws():
    assert E.physical(values_of(E)) is None
    told = E.report({"es": 3e-3, "ec": 4e-3}, 1e-8 * np.eye(2))
    assert told["e"]["value"] == pytest.approx(5e-3) and told["e"]["std"] == pytest.approx(1e-4)
    check_report("encoder_eccentricity")
