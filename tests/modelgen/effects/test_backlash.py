"""backlash: position torques shift by the place in the gap; the drop is what is not passed on meanwhile."""

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
from modelgen.effects.states import integrate_play

E = effect("backlash")


def gravity_slope(model, m, j):
    """d torque / d q_j of gravity alone: all rates zero, central differences."""
    rest = np.zeros_like(m.q)
    step = 1e-5 * np.eye(m.q.shape[1])[j]
    up, down = (model.torque(m, m.q + s * step, rest, rest) for s in (1, -1))
    return (up - down) / 2e-5


def test_columns_are_the_shift_of_the_position_torques():
    model = arm_model(("motor", "sensor"), dry=False)
    m, place = motion(model, 4.0, pace=0.1), first_place(E, model)
    v = {"gap": 2e-3, "travel": 2e-3}
    z = integrate_play(m.q[:, 1], {"travel": 2e-3})
    seen = contribution(E, place, v, m, model)
    expected = gravity_slope(model, m, 1) * (-z / 2 * 2e-3)[:, None]  # slow: nearly all torque is gravity's
    assert seen == pytest.approx(expected, abs=0.02 * np.abs(expected).max())
    simulated = added(model, m, E, place, {**v, "drop": 0.0})
    flank = np.convolve(np.abs(np.gradient(z)), np.ones(81), "same") == 0  # away from impacts
    assert flank.mean() > 0.3
    assert simulated[flank] == pytest.approx(expected[flank], abs=0.03 * np.abs(expected).max())


def test_the_drop_is_the_link_torque_while_the_gap_is_crossed():
    model = arm_model(("motor", "sensor"), dry=False)
    m = motion(model, 4.0)
    place = next(p for p in E.places(layout(model)) if p.joint == 1 and p.parts == ("drop",))
    v = {"gap": 0.0, "travel": 0.02, "drop": 0.8}
    crossing = 1 - np.clip(5 * np.abs(integrate_play(m.q[:, 1], {"travel": 0.02})) - 4, 0, 1)
    expected = np.zeros((len(m.t), 8))
    expected[:, [1, 5]] = (-0.8 * crossing * model.link_torque(m)[:, 1])[:, None]
    assert contribution(E, place, v, m, model) == pytest.approx(expected, abs=1e-9)
    assert added(model, m, E, place, v) == pytest.approx(expected, abs=1e-9)


def test_blocks_go_on_where_the_last_one_ended():
    model = arm_model(dry=False)
    m, place = motion(model, 3.0), first_place(E, model)
    assert split_agrees(E, place, {"gap": 2e-3, "travel": 0.05}, m, model) < 1e-9


def test_places_signs_and_spread():
    places = list(E.places(layout(arm_model())))
    assert {p.parts for p in places} == {("gap",), ("gap", "drop"), ("drop",)} and len(places) == 12
    assert not list(E.places(layout(arm_model(("drive",)))))
    assert "gap would be negative" in E.physical({**values_of(E), "gap": -1.0})
    check_report("backlash")


def test_a_gap_that_two_numbers_measure_is_their_mean():
    """A gear's drop shows its travel to a hundredth where gravity shows nothing of the gap: the gap was told
    as 0 +- 0.8 mrad, and the finding withdrawn."""
    v = {"gap": 0.0, "drop": 1.0, "travel": 6e-4}
    told = E.report(v, np.diag([8e-4, 5e-3, 5e-6]) ** 2)
    assert told["gap"]["value"] == pytest.approx(6e-4, rel=1e-3)
    assert told["gap"]["std"] == pytest.approx(5e-6, rel=1e-3)
    told = E.report({**v, "gap": 5e-4}, np.diag([1e-4, 5e-3, 1e-4]) ** 2)
    assert told["gap"]["value"] == pytest.approx(5.5e-4) and told["gap"]["std"] == pytest.approx(
        1e-4 / 2**0.5
    )
    told = E.report({**v, "gap": 2e-4}, np.diag([1e-4, 5e-3, 1e-4]) ** 2)  # 2.8 deviations apart
    assert told["gap"]["value"] == pytest.approx(4e-4) and told["gap"]["std"] == pytest.approx(2e-4)
    assert E.report({**v, "gap": 4e-4}, None)["gap"]["value"] == 4e-4  # as it is given
    assert "gap" not in E.needed  # a drop alone is a backlash
