"""joint_coupling: rate, acceleration and dry friction of another joint's drive."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, layout, motion, values_of

from modelgen.effects import effect
from modelgen.effects.effect import Place

E = effect("joint_coupling")


def test_columns_follow_the_other_joint():
    model = arm_model(("motor", "sensor"), dry=False)
    m, v = motion(model, 1.0), values_of(E, Fc=0.5)
    place = Place(2, 0, "motor", parts=("Fv", "Ia", "Fc"))
    expected = np.zeros((len(m.t), 8))
    total = m.dq[:, 2] + m.dq[:, 0]
    expected[:, 2] = v["Fv"] * m.dq[:, 0] + v["Ia"] * m.ddq[:, 0] + 0.5 * np.sign(total)
    assert contribution(E, place, v, m, model) == pytest.approx(expected, abs=1e-9)
    assert added(model, m, E, place, v) == pytest.approx(expected, abs=1e-9)


def test_a_smooth_sign_of_the_sum_is_as_smooth_as_the_joints():
    from dataclasses import replace

    model = arm_model()
    m = motion(model, 2.0)
    m = replace(m, sign_dq=np.tanh(m.dq / 0.05))
    column = E.columns(Place(2, 0, "motor", parts=("Fc",)), {}, None, m, model)[2][:, 0]
    assert column == pytest.approx(np.tanh((m.dq[:, 2] + m.dq[:, 0]) / 0.05), abs=1e-6)


def test_places_are_ordered_pairs_and_units_follow_both_joints():
    places = list(E.places(layout(arm_model())))
    assert {(p.joint, p.source) for p in places} == {(j, s) for j in range(4) for s in range(4) if j != s}
    assert {p.parts for p in places} == {("Fv",), ("Ia",), ("Fv", "Ia"), ("Fv", "Ia", "Fc")}
    mixed = Place(0, 1, prismatic=False, source_prismatic=True)
    assert [E.unit(p, mixed) for p in E.linear] == ["N m s/m", "kg m", "N m"]


def test_friction_is_positive_and_spread_is_that_of_draws():
    assert "Fc would be negative" in E.physical({"Fc": -1.0})
    check_report("joint_coupling")
