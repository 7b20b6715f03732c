"""payload_change: the columns of a body on any link, a mass that cannot be seen is not told."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, layout, motion, values_of

from modelgen.effects import effect
from modelgen.effects.catalogue.payload_change import REACH, WEIGHT, visible
from modelgen.effects.effect import Place
from modelgen.effects.loads import arm_length

E = effect("payload_change")


@pytest.mark.parametrize("link", [1, 2, 3, 4])
def test_columns_are_the_torque_of_a_heavier_link(link):
    """The model with the body's parameters added to the link's own, less the model."""
    model = arm_model(("motor", "sensor"))
    m, v = motion(model, 2.0), values_of(E)
    place = Place(link=link, side="link", recording="run1", start=0.5, parts=E.linear_names)
    heavier = {**model.standard}
    for kind, value in v.items():
        heavier[f"{kind}{link}"] += value
    inside = (m.t >= 0.5)[:, None]
    expected = inside * (type(model)(model.robot, model.channels, heavier).torque(m) - model.torque(m))
    assert contribution(E, place, v, m, model) == pytest.approx(expected, abs=1e-9)
    assert added(model, m, E, place, v) == pytest.approx(expected, abs=1e-9)


def test_another_recording_does_not_carry_it():
    model = arm_model()
    m = motion(model, 0.5)
    place = Place(link=4, side="link", recording="run2", parts=WEIGHT)
    assert not any(c.any() for c in E.columns(place, {}, None, m, model).values())
    assert not added(model, m, E, place, values_of(E)).any()


def test_every_link_that_moves_is_a_place_with_independent_columns():
    model = arm_model()
    places = list(E.places(layout(model, ("run1", "run2"))))
    assert {p.link for p in places} == {1, 2, 3, 4} and {p.recording for p in places} == {"run1", "run2"}
    m = motion(model, 2.0, rate=50.0)
    for place in (p for p in places if p.recording == "run1"):
        columns = E.columns(place, {}, None, m, model)
        W = np.concatenate([columns[c] for c in sorted(columns)])
        assert np.linalg.matrix_rank(W / np.linalg.norm(W, axis=0), tol=1e-6) == W.shape[1], place
    assert places[0].link == 4 and places[0].parts == WEIGHT


def test_a_mass_that_the_motion_cannot_show_is_not_told():
    """Link 1 turns about a fixed vertical axis: only its inertia about it shows."""
    shown, full = visible(arm_model().robot, 1)
    assert shown == full == ("ZZ",)
    shown, _ = visible(arm_model().robot, 2)
    assert "M" not in shown and {"MX", "MY"} <= set(shown)
    assert E.report({"ZZ": 0.1}, np.array([[1e-4]])) == {}
    assert set(E.report({"MX": 0.1, "MY": 0.2}, 1e-4 * np.eye(2))) == {"mx", "my"}


def test_a_mass_is_positive_and_lies_where_it_is_usual():
    assert E.physical(values_of(E)) is None
    assert "M would be negative" in E.physical({**values_of(E), "M": -1.0})
    assert "a body has a mass" in E.physical({**values_of(E), "M": 0.0})
    assert E.physical({"ZZ": 0.1}) is None  # a mass that the motion cannot show
    assert E.usual({"m": 3.0}, {}) == pytest.approx({"m": 3.0, "mx": 0.06, "my": -0.04, "mz": 0.24})


def test_a_first_moment_is_a_mass_times_a_place_within_the_arms_reach():
    """In deviations along what the motion shows best; without a mass that it shows nothing is asked."""
    model = arm_model()
    place = next(iter(E.places(layout(model, ("run1",)))))
    sure = np.diag([0.03, 0.01, 0.01, 0.5]) ** 2
    reach = max(REACH, arm_length(model.robot))
    weight = dict(zip(WEIGHT, [0.0, 0.0, 0.4, -0.7]))
    told = E.beyond(weight, sure, place, model.robot)
    assert told == pytest.approx(0.4 / np.hypot(0.01, 0.03 * reach), rel=0.02)
    assert E.beyond(values_of(E), sure, place, model.robot) == 0.0
    assert E.beyond({**weight, "M": 0.5}, sure, place, model.robot) == 0.0
    assert E.beyond(weight, 1e3 * sure, place, model.robot) < 1.0
    light = next(p for p in E.places(layout(model, ("run1",))) if p.link == 2 and "M" not in p.parts)
    values = dict.fromkeys(light.parts, 0.4)
    assert E.beyond(values, 1e-6 * np.eye(len(values)), light, model.robot) == 0.0


def test_reported_spread_is_that_of_draws():
    check_report("payload_change")
