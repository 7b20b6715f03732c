"""time_delay: the modelled torque at another time, exactly, earlier or later."""

from dataclasses import replace

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, first_place, layout, motion, values_of

from modelgen.effects import effect

E = effect("time_delay")


@pytest.mark.parametrize("delay", [0.006, -0.006, 0.0333, -0.05])
def test_columns_are_the_torque_at_another_time(delay):
    """The motion is a formula: the same sines evaluated at t - delay."""
    model = arm_model(("motor", "sensor"), dry=False)
    m = motion(model, 4.0)
    fine = motion(model, 4.0, rate=500.0)
    k = round(delay * 30000)
    dense = motion(model, 4.0, rate=30000.0)
    rows = np.arange(len(fine.t)) * 60 - k
    good = (rows >= 0) & (rows < len(dense.t)) & (np.abs(fine.t - 2) < 1.8)
    arrays = {n: getattr(dense, n)[rows[good]] for n in ("t", "q", "dq", "ddq", "sign_dq")}
    expected = model.torque(replace(dense, **arrays)) - model.torque(m)[good]
    place, v = first_place(E, model, None), values_of(E, delay=k / 30000)
    assert contribution(E, place, v, m, model)[good] == pytest.approx(expected, abs=1e-6)
    assert added(model, m, E, place, v)[good] == pytest.approx(expected, abs=2e-3)  # linear between samples


def test_the_tangent_is_the_slope():
    model = arm_model(dry=False)
    m, place = motion(model, 2.0), first_place(E, model, None)
    for c, column in E.columns(place, {}, None, m, model).items():
        slope = -np.gradient(model.torque(m)[:, c], m.t, edge_order=2)
        assert column[:, 0] == pytest.approx(slope, abs=0.01 * np.abs(slope).max())


def test_all_torques_of_a_kind_may_share_it():
    sides = (("motor",), ("motor", "sensor"), ("drive",))
    one, both, none = (list(E.places(layout(arm_model(s)))) for s in sides)
    assert [(p.joint, p.side) for p in one] == [(None, None), *((j, "motor") for j in range(4))]
    assert [(p.joint, p.side) for p in both][:3] == [(None, None), (None, "motor"), (None, "sensor")]
    assert len(both) == 11 and [p.side for p in none] == [None]  # both torques late together
    channels = arm_model(("motor", "sensor")).channels
    assert [len(p.rows(channels)) for p in both[:4]] == [8, 4, 4, 1]


def test_it_may_be_negative_and_tells_its_spread():
    assert E.physical({"delay": -0.01}) is None
    assert E.unit(E.linear[0], first_place(E, arm_model())) == "s"
    check_report("time_delay")
