"""torque_lag: the exact answer of a first-order low-pass, in one piece or in blocks."""

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
from scipy.integrate import solve_ivp

from modelgen.effects import effect
from modelgen.effects.catalogue.torque_lag import lagged

E = effect("torque_lag")


@pytest.mark.parametrize("T", [0.002, 0.02, 0.15])
def test_the_lag_solves_its_differential_equation(T):
    t = np.arange(200) * 0.004
    tau = np.sin(9 * t) + 0.3 * np.cos(23 * t)

    def slope(now, y):
        return (np.interp(now, t, tau) - y) / T

    solved = solve_ivp(slope, (0, t[-1]), [tau[0]], t_eval=t, rtol=1e-10, atol=1e-12, max_step=1e-3)
    assert lagged(tau, T, 0.004) == pytest.approx(solved.y[0], abs=1e-6)


def test_columns_are_what_the_recorder_does():
    model = arm_model(("motor", "sensor"), dry=False)
    m, place, v = motion(model, 3.0), first_place(E, model), values_of(E)
    seen = contribution(E, place, v, m, model)
    tau = model.torque(m)[:, 1]
    assert seen[:, 1] == pytest.approx(lagged(tau, 0.01, 1 / m.rate_hz) - tau, abs=1e-12)
    assert not np.delete(seen, 1, axis=1).any()
    assert added(model, m, E, place, v) == pytest.approx(seen, abs=1e-9)


def test_a_slow_torque_lags_as_if_delayed():
    model = arm_model(dry=False)
    m, place = motion(model, 6.0, pace=0.2), first_place(E, model)
    lag = contribution(E, place, values_of(E), m, model)[200:-200]
    late = contribution(effect("time_delay"), place, {"delay": 0.01}, m, model)[200:-200]
    assert lag == pytest.approx(late, abs=0.01 * np.abs(late).max())


def test_blocks_places_signs_and_spread():
    model = arm_model(dry=False)
    m = motion(model, 2.0)
    assert split_agrees(E, first_place(E, model), values_of(E), m, model) < 1e-9
    assert [p.side for p in E.places(layout(arm_model(("motor", "sensor"))))] == ["motor"] * 4 + [
        "sensor"
    ] * 4
    assert "time_constant would be negative" in E.physical({"time_constant": -0.1})
    check_report("torque_lag")
