"""stiffening_gear: two parts of one deflection, whose columns together are what the gear leaves."""

import numpy as np
import pytest
from effect_model import (
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

E = effect("stiffening_gear")


def test_columns_are_what_a_stiffening_gear_leaves():
    model = arm_model(("motor", "sensor"), dry=False)
    m, place = motion(model, 8.0, pace=0.5), first_place(E, model)
    v = values_of(E, compliance=1e-3, cubic=-3e-7)
    seen, left = as_recorded_by(E, model, m, place, v)
    inner = slice(500, -500)
    size = np.abs(left[inner]).max()
    assert contribution(E, place, v, seen, model)[inner] == pytest.approx(left[inner], abs=0.05 * size)
    soft = as_recorded_by(E, model, m, place, {**v, "cubic": 0.0})[1]
    assert np.abs(soft - left)[inner].max() > 0.2 * size  # the cubic part is there to be seen


def test_without_its_cubic_part_it_is_an_elastic_joint():
    model = arm_model(dry=False)
    m, place = motion(model, 3.0), first_place(E, model)
    elastic = effect("joint_elasticity").columns(place, {}, None, m, model)
    for c, column in E.columns(place, {}, None, m, model).items():
        assert column[:, :1] == pytest.approx(elastic[c])


def test_places_signs_and_spread():
    assert [p.joint for p in E.places(layout(arm_model()))] == [0, 1, 2, 3]
    assert not list(E.places(layout(arm_model(("drive",)))))
    assert E.physical(values_of(E)) is None
    assert "compliance would be negative" in E.physical({**values_of(E), "compliance": -1.0})
    check_report("stiffening_gear")
