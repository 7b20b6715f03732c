"""A torque that is noise for a while, beside what shakes, hums, leaps or moves fast by itself."""

import numpy as np
import pytest

from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.noise_bursts import noise_bursts
from ident.examination.tables.signals import Columns
from ident.examination.undone import unsettled

T = np.arange(3000) / 100.0
Q = np.stack([np.sin(0.8 * T), 0.7 * np.cos(1.3 * T)], axis=1)


def _said(tau):
    excerpt = Excerpt()
    excerpt.take((np.arange(len(T)), T, np.hstack([Q, tau])))
    names, joints = ("q1", "q2", "tau_m1", "tau_m2"), np.array([0, 1, 0, 1])
    columns = Columns("run", names, joints, ("1", "2"), {}, ("tau_m1", "tau_m2"), np.zeros(2, bool))
    return list(noise_bursts(columns, excerpt, ()))


def _torques(noise=0.02):
    rubs = np.sign(np.gradient(Q, axis=0))
    return 5 * Q[:, ::-1] + 2 * rubs + noise * np.random.default_rng(1).normal(size=Q.shape)


def test_a_torque_that_is_noise_for_a_while():
    """Of an AIRBOT's second torque, with bursts of two deviations, nothing was said though 18 % were left."""
    tau = _torques()
    assert not _said(tau)
    for begin in (640, 1900):
        tau[begin : begin + 160, 1] += 2.5 * np.std(tau[:, 1]) * np.random.default_rng(begin).normal(size=160)
    (told,) = _said(tau)
    assert told.signals == ("tau_m2",) and told.hint
    assert unsettled([told]) == (told,)  # all else is told with it in the torque
    assert told.message.startswith("tau_m2 is noise for a while (rows 641 to ")


@pytest.mark.parametrize("way", ["noise", "hum", "spikes", "leap", "shakes", "fast"])
def test_what_is_no_burst(way):
    tau = _torques(4.0) if way == "noise" else _torques()
    size = np.std(tau[:, 0])
    if way == "hum":
        tau[:, 0] += 0.7 * size * np.sin(2 * np.pi * 50.02 * T)
    if way == "spikes":
        tau[::25, 0] += 20 * size
    if way == "leap":
        tau[1500:, 0] *= -1
    if way == "shakes":  # from one row to the next, by a third of it
        tau[700:800, 0] += 0.33 * size * (-1) ** np.arange(100)
    if way == "fast":
        tau[700:800, 0] += 3 * size * np.sin(2 * np.pi * 4 * T[:100])
    assert not _said(tau)
