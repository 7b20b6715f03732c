"""Derivatives of the arm's torque by one joint's motion: what little displacements are made of."""

import numpy as np
import pytest
from effect_model import arm_model, motion

from modelgen.effects.motions import displaced_torque, little_displaced


@pytest.mark.parametrize("joint", [0, 1, 2, 3])
@pytest.mark.parametrize("follows", [False, True])
def test_a_little_displacement_is_the_torque_of_a_larger_one_made_smaller(joint, follows):
    model = arm_model(("motor", "sensor"), dry=False)
    m = motion(model, 1.0)
    rng = np.random.default_rng(joint)
    shift = tuple(rng.normal(size=len(m.t)) for _ in range(3))
    wanted = [
        displaced_torque(model, m, joint, tuple(h * x for x in shift), drive_follows=follows) / h
        for h in (1e-4, -1e-4)
    ]
    told = little_displaced(model, m, joint, shift, drive_follows=follows)
    assert told == pytest.approx(sum(wanted) / 2, abs=1e-6 * np.abs(wanted).max())


def test_rates_and_accelerations_have_slopes_without_a_rest():
    model = arm_model(dry=False)
    m = motion(model, 1.0)
    _, by_rate, by_acceleration = model.slopes(m, 1)
    dq, ddq = m.dq.copy(), m.ddq.copy()
    dq[:, 1] *= -1  # the torque is quadratic: its chord has the slope of the middle, a rate of zero
    still = model.slopes(type(m)(**{**vars(m), "dq": (m.dq + dq) / 2}), 1)[1]
    chord = model.torque(m) - model.torque(m, dq=dq)
    assert chord == pytest.approx(2 * m.dq[:, [1]] * still, abs=1e-9)
    assert np.abs(by_rate - still).max() > 1e-3
    ddq[:, 1] += 0.7
    assert model.torque(m, ddq=ddq) - model.torque(m) == pytest.approx(0.7 * by_acceleration, abs=1e-9)
