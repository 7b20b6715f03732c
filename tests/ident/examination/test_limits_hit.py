"""Torques that stay at their largest value, of which some are clipped."""

import numpy as np
import pytest

from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.repeats import stepped
from ident.examination.tables.signals import Columns, limits_hit


def _said(t, q, tau, in_steps=lambda x: False):
    excerpt = Excerpt()
    for part in np.array_split(np.arange(len(t)), 3):
        excerpt.take((part, t[part], np.stack([q, tau], 1)[part]))
    columns = Columns("run", ("q1", "tau_m1"), np.zeros(2, int), ("1",), {}, ("tau_m1",), np.ones(1, bool))
    return list(limits_hit(columns, excerpt, (), in_steps))


@pytest.mark.parametrize("clipped", [False, True])
def test_a_coarse_torque_of_dry_friction_and_weight_is_not_clipped(clipped):
    """Of a slide in 120 steps of force three torques were told as clipped."""
    t = np.arange(30000) / 500.0
    q = 0.3 * np.sin(0.9 * t) + 0.1 * np.sin(2.3 * t)
    dq = 0.27 * np.cos(0.9 * t) + 0.23 * np.cos(2.3 * t)
    tau = 40 + 40 * np.tanh(dq / 0.004) + 8 * np.tanh((q - 0.1) / 0.002)
    if clipped:
        tau = np.minimum(30 * q + 60 * dq, 14)
    step = np.ptp(tau) / 120
    tau = step * np.rint(tau / step)
    assert [c.check for c in _said(t, q, tau, stepped)] == ["saturation"] * clipped


@pytest.mark.parametrize("ends", [(-9, 9), (-9, 99), (-6, 9)])
def test_a_torque_that_is_clipped_at_both_ends_has_no_play(ends):
    """Of a Franka's second in the fitted run, of which 60 % were one value, play of its sensor was told; of
    most robots', as what stood at its own limits was what stands elsewhere."""
    t = np.arange(30000) / 500.0
    tau = 12 * np.sin(0.9 * t) + 4 * np.sin(7.3 * t)
    (told,) = _said(t, np.sin(0.9 * t), np.clip(tau, *ends))
    assert told.check == "saturation" and " its smallest value" in told.message
    assert ("largest value" in told.message) == (ends[1] == 9)
    held = tau.copy()
    for k in range(1, len(t)):
        held[k] = np.clip(held[k - 1], tau[k] - 2, tau[k] + 2)
    assert "saturation" not in {c.check for c in _said(t, np.sin(0.9 * t), held)}
