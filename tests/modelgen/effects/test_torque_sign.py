"""torque_sign: the rows of one channel change sign, exactly, and nothing else does."""

import numpy as np
import pytest
from effect_model import added, arm_model, first_place, layout, motion, recorded, simulated

from modelgen.effects import effect

E = effect("torque_sign")


def test_the_changed_regressor_is_the_flipped_one():
    model = arm_model(("motor", "sensor"))
    m, place = motion(model, 1.0), first_place(E, model)
    W = model.regressor(m)
    change = E.regressor_change(place, {}, m, model)
    total = W + np.stack([change[k] for k in range(W.shape[2])], axis=2)
    assert np.array_equal(total[:, 1], -W[:, 1])
    assert np.array_equal(np.delete(total, 1, axis=1), np.delete(W, 1, axis=1))
    assert all(c.shape == (len(m.t), 0) for c in E.columns(place, {}, None, m, model).values())
    chi = np.array(list(model.standard.values()))
    assert E.torque_change(place, {}, m, model, chi) == pytest.approx((total - W) @ chi, abs=1e-9)
    truth = recorded(model, simulated(model, m, E, place, {}))
    assert truth == pytest.approx(total @ chi, abs=1e-9)


def test_a_flipped_sensor_leaves_the_motor_alone():
    model = arm_model(("motor", "sensor"))
    m = motion(model, 0.5)
    place = next(p for p in E.places(layout(model)) if p.side == "sensor" and p.joint == 2)
    change = added(model, m, E, place, {})
    assert change[:, 6].any() and not np.delete(change, 6, axis=1).any()


def test_it_has_no_number_and_stands_on_each_measured_torque():
    assert E.quantities == () and E.report({}, None) == {} and E.physical({}) is None
    assert len(list(E.places(layout(arm_model())))) == 4
    assert not list(E.places(layout(arm_model(("drive",)))))
