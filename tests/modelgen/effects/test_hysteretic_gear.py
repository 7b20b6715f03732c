"""hysteretic_gear: a loop of angle against torque; its columns are what the gear leaves."""

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
    simulated,
    split_agrees,
    values_of,
)

from modelgen.effects import effect

E = effect("hysteretic_gear")


def test_columns_are_what_the_gear_leaves():
    model = arm_model(("motor", "sensor"), dry=False)
    m, place, v = motion(model, 8.0, pace=0.5), first_place(E, model), values_of(E, lost=3e-3, width=5.0)
    seen, left = as_recorded_by(E, model, m, place, v)
    # impacts of the loop's corners are above the shift's low-pass: compare what is slow
    kernel = np.hanning(401) / np.hanning(401).sum()

    def slow(x):
        return np.stack([np.convolve(c, kernel, "valid") for c in x.T], axis=1)[400:-400]

    wanted = slow(left)
    got = slow(contribution(E, place, v, seen, model))
    assert np.sqrt(np.mean((got - wanted) ** 2)) < 0.25 * np.sqrt(np.mean(wanted**2))


def test_its_angle_lags_in_a_loop_of_width_two_lost():
    model = arm_model(dry=False)
    m, place, v = (
        motion(model, 8.0),
        first_place(E, model),
        values_of(E, compliance=1e-9, lost=3e-3, width=0.5),
    )
    truth = simulated(model, m, E, place, v)
    angle = (truth.motor[0] - m.q)[:, 1]
    assert np.ptp(angle) == pytest.approx(6e-3, rel=0.02)


def test_blocks_go_on_where_the_last_one_ended():
    model = arm_model(dry=False)
    m, place = motion(model, 3.0), first_place(E, model)
    theta = {"width": 5.0}
    z = E.numpy_columns({"tau_link": model.link_torque(m)[:, 1], "ddq": m.ddq[:, 1]}, theta)[:, 1]
    assert np.abs(z).max() <= 1.0 and np.ptp(z) > 1.0
    assert split_agrees(E, place, {**values_of(E), "lost": 0.0, "compliance": 0.0}, m, model) == 0.0


def test_places_signs_and_spread():
    assert [p.joint for p in E.places(layout(arm_model()))] == [0, 1, 2, 3]
    assert "lost would be negative" in E.physical({**values_of(E), "lost": -1.0})
    check_report("hysteretic_gear")
