"""Torques that fall to zero for some rows behind each turn of a joint, beside what else torques do."""

import numpy as np
import pytest

from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.signals import Columns
from ident.examination.tables.torque_drops import torque_drops

T = np.arange(6000) / 250.0
Q = np.stack([np.sin(1.6 * T), 0.7 * np.cos(2.6 * T)], axis=1)


def _said(tau, q=Q):
    excerpt = Excerpt()
    excerpt.take((np.arange(len(T)), T, np.hstack([q + 1e-5 * _noise(2), tau])))
    names, joints = ("q1", "q2", "tau_m1", "tau_m2"), np.array([0, 1, 0, 1])
    columns = Columns("run", names, joints, ("1", "2"), {}, ("tau_m1", "tau_m2"), np.zeros(2, bool))
    return list(torque_drops(columns, excerpt))


def _noise(seed):
    return np.random.default_rng(seed).normal(size=Q.shape)


def _torques():
    rubs = np.sign(np.gradient(Q, axis=0))  # in one row
    return 20.0 + 5 * Q[:, ::-1] + 2 * rubs + 0.05 * _noise(1)


def _turning(j):
    return np.flatnonzero(np.diff(np.sign(np.gradient(Q[:, j]))) != 0)


@pytest.mark.parametrize("joint", [0, 1])
def test_what_falls_to_zero_where_a_joint_turns(joint):
    tau = _torques()
    assert not _said(tau)
    for row in _turning(joint):
        tau[row + 2 : row + 5, 1] = 0.3 * _noise(3)[row : row + 3, 1]
    (told,) = _said(tau)
    assert told.check == "torque_drop" and told.signals == ("tau_m2",) and not told.hint
    many = len(_turning(joint))
    assert f"{many} times, for up to 0.01" in told.message
    assert f"{many} of them within 0.05 s after joint {joint + 1} turns" in told.message
    assert f"gear of joint {joint + 1}" in told.remedy


@pytest.mark.parametrize(("least", "magnitude"), [(0.0, True), (-0.1, False)])
def test_a_torque_of_one_sign_may_be_a_magnitude(least, magnitude):
    """Of an LWR4+ whose torques had lost their signs play in a gear was told alone."""
    tau = _torques()
    for row in _turning(1):
        tau[row + 2 : row + 5, 1] = least
    (told,) = _said(tau)
    assert ("without its sign" in told.message) is magnitude is ("with their signs" in told.remedy)


def test_joints_that_turn_together_are_both_told():
    """One signal for both: whose gear it is nothing tells. A torque that falls elsewhere is not named."""
    tau = _torques()
    for row in _turning(1):
        tau[row + 2 : row + 5, 1] = 0.0
    tau[1003:1006, 0] = 0.0
    (told,) = _said(tau, Q[:, [1, 1]] * [0.5, 1.0])
    assert told.signals == ("tau_m2",)
    assert "gear of joint 2 or 1" in told.remedy or "gear of joint 1 or 2" in told.remedy


@pytest.mark.parametrize("way", ["anywhere", "half", "stays", "away"])
def test_what_does_so_by_itself(way):
    tau, rows = _torques(), _turning(1)
    if way == "anywhere":  # what disturbs the sensor or the logger
        rows = np.random.default_rng(4).integers(100, len(T) - 100, len(rows))
    for row in rows:
        if way == "stays":
            tau[row + 2 : row + 80, 1] = 0.0
        else:
            tau[row + 2 : row + 5, 1] *= {"half": 0.5, "away": 2.0}.get(way, 0.0)  # sticking friction
    assert not _said(tau)


def test_spikes_where_joints_stop_of_which_some_end_near_zero_are_no_falls():
    """As of a robot whose friction takes the other sign for one row, at each stop of all joints at once."""
    tau, rows = _torques(), _turning(1)
    sizes = np.where(np.arange(len(rows)) % 3 == 0, 20.0, 35.0)
    tau[rows + 2, 1] -= sizes
    assert not _said(tau)
    tau = _torques()
    tau[rows + 2, 1] -= 20.0
    assert _said(tau)


def test_a_torque_that_goes_through_zero_as_its_joint_brakes_and_goes_back_does_not_fall():
    """From point to point: of an arm in MuJoCo at 100 Hz a gear was told to have play."""
    tau = _torques()
    for row in _turning(1):
        away = np.abs(np.arange(len(T)) - (row + 8)) / 6.0
        tau[:, 1] *= np.minimum(away, 1.0)
    assert not _said(tau)
