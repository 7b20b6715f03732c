"""joint_elasticity: recorded torque against the model at the motor's positions is what its columns say."""

from dataclasses import replace

import numpy as np
import pytest
from effect_model import (
    added,
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

E = effect("joint_elasticity")


@pytest.mark.parametrize("k", [3000.0, 600.0])
def test_columns_are_what_an_elastic_arm_leaves(k):
    model = arm_model(("motor", "sensor"), dry=False)
    m, place, v = motion(model, 8.0, pace=0.5), first_place(E, model), values_of(E, k=k)
    seen, left = as_recorded_by(E, model, m, place, v)
    inner = slice(500, -500)
    size = np.abs(left[inner]).max()
    assert size > 0.01
    assert contribution(E, place, v, seen, model)[inner] == pytest.approx(left[inner], abs=0.05 * size)


def test_the_tangent_is_the_secant_of_a_stiff_joint():
    model = arm_model(dry=False)
    m, place = motion(model, 6.0), first_place(E, model)
    tangent, secant = (E.columns(place, {}, size, m, model) for size in (None, np.array([1e-6])))
    for c, column in tangent.items():
        assert column == pytest.approx(secant[c], abs=2e-3 * np.abs(column).max() + 1e-6)


@pytest.mark.parametrize(
    "name", ["joint_elasticity", "stiffening_gear", "hysteretic_gear", "kinematic_error"]
)
def test_a_rotor_inside_a_regrouped_inertia_stays_with_the_motor(name):
    gear, apart = effect(name), arm_model(dry=False)
    regrouped = dict(apart.standard)
    regrouped["ZZ1"] += regrouped.pop("Iam1")  # the same torques of joint 1: the first axis' base parameter
    together = replace(apart, standard=regrouped)
    m, place = motion(apart, 6.0, pace=0.5), next(p for p in gear.places(layout(apart)) if p.joint == 0)
    assert together.torque(m) == pytest.approx(apart.torque(m))
    size = np.array([1e-3, 1e-8][: len(gear.parameters_of(place))])
    known, found, without = (
        gear.columns(place, {"Iam": rotor}, size, m, model)[0] @ size
        for rotor, model in ((0.0, apart), (apart.standard["Iam1"], together), (0.0, together))
    )
    assert found == pytest.approx(known, abs=1e-6 * np.abs(known).max())
    assert np.abs(without - known).max() > 0.2 * np.abs(known).max()


def test_the_rotor_is_searched_only_where_the_model_hides_it():
    model = arm_model()
    hidden = replace(layout(model), drives=(frozenset({"Fvm"}), *(frozenset({"Iam"}),) * 3))
    assert [set(E.bounds(p)) for p in E.places(hidden)] == [{"Iam"}, set(), set(), set()]


def test_it_stands_on_each_joint_but_in_a_difference():
    assert [p.joint for p in E.places(layout(arm_model()))] == [0, 1, 2, 3]
    assert not list(E.places(layout(arm_model(("drive",)))))
    model = arm_model(dry=False)
    m = motion(model, 1.0)
    assert added(model, m, E, first_place(E, model), values_of(E))[:, 1].any()


def test_a_spring_pushes_back():
    assert E.physical(values_of(E)) is None
    assert "compliance would be negative" in E.physical({"compliance": -1e-3})
    assert E.report({"compliance": 5e-4}, np.array([[1e-10]]))["k"]["std"] == pytest.approx(1e-5 / 5e-4**2)
    check_report("joint_elasticity")
