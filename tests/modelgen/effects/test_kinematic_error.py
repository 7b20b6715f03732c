"""kinematic_error: torque of a link that errs periodically from its motor, and its searched waves."""

from dataclasses import replace

import numpy as np
import pytest
from effect_model import (
    SLIDE,
    added,
    arm_model,
    check_report,
    contribution,
    first_place,
    layout,
    motion,
    values_of,
)

from modelgen.effects import effect

E = effect("kinematic_error")


@pytest.mark.first_case
@pytest.mark.parametrize("wavenumber", [1.0, 2.0, 60.0])
def test_columns_are_the_torque_of_the_displaced_link(wavenumber):
    model = arm_model(("motor", "sensor"), dry=False)
    m, place = motion(model, 2.0, rate=4000.0), first_place(E, model)
    v = values_of(E, e=2e-5, wavenumber=wavenumber)
    wanted = added(model, m, E, place, v)[20:-20]  # rates by differences of the shift
    seen = contribution(E, place, v, m, model)[20:-20]
    assert seen == pytest.approx(wanted, abs=2e-3 * np.abs(wanted).max())
    assert np.abs(seen[:, [0, 2]]).max() > 0  # the neighbours feel it


def test_the_rotor_does_not_follow_the_link():
    heavy = arm_model(dry=False)
    light = type(heavy)(heavy.robot, heavy.channels, {**heavy.standard, "Iam2": 0.0, "Fvm2": 0.0})
    m, place = motion(heavy, 1.0), first_place(E, heavy)
    a, b = (contribution(E, place, values_of(E), m, model) for model in (heavy, light))
    assert a == pytest.approx(b, abs=1e-7)


def test_waves_of_the_residual_are_starts():
    model = arm_model(dry=False)
    m, place = motion(model, 20.0, rate=100.0), first_place(E, model)
    residual = np.sin(37.3 * m.q[:, 1] + 0.4) + 0.3 * np.random.default_rng(0).normal(size=len(m.t))
    starts = [s["wavenumber"] for s in E.starts(place, [m], [residual])]
    assert starts[:2] == [1.0, 2.0] and min(abs(w - 37.3) for w in starts) < 0.5


def test_a_ball_screw_is_searched_to_its_lead():
    slide = arm_model(text=SLIDE)
    known = replace(layout(slide), travel=(5.0, 0.5))
    place = next(p for p in E.places(known) if p.joint == 1)
    low, high = E.bounds(place)["wavenumber"]
    assert low == pytest.approx(2 * np.pi * 0.75 / 0.5) and high == pytest.approx(2 * np.pi / 0.002)
    told = E.report(values_of(E), None, None, place)
    assert [told[k]["unit"] for k in ("e", "wavenumber", "phi")] == ["m", "1/m", "rad"]


def test_the_rotor_is_searched_only_where_the_model_hides_it():
    model = arm_model()
    hidden = replace(layout(model), drives=(frozenset({"Fvm"}), *(frozenset({"Iam"}),) * 3))
    assert ["Iam" in E.bounds(p) for p in E.places(hidden)] == [True, False, False, False]


def test_places_signs_and_spread():
    assert len(list(E.places(layout(arm_model())))) == 4
    assert not list(E.places(layout(arm_model(("drive",)))))
    assert "wavenumber would be negative" in E.physical({**values_of(E), "wavenumber": -1.0})
    check_report("kinematic_error")
