"""A torque that leaps in a row and stays there, beside what a torque does by itself."""

import numpy as np
import pytest

from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.signals import Columns
from ident.examination.tables.torque_leaps import torque_leaps

T = np.arange(3000) / 250.0
Q = np.stack([np.sin(0.8 * T), 0.7 * np.cos(1.3 * T)], axis=1)


def _said(tau, q=Q):
    excerpt = Excerpt()
    excerpt.take((np.arange(len(T)), T, np.hstack([q, tau])))
    names, joints = ("q1", "q2", "tau_m1", "tau_m2"), np.array([0, 1, 0, 1])
    columns = Columns("run", names, joints, ("1", "2"), {}, ("tau_m1", "tau_m2"), np.zeros(2, bool))
    return list(torque_leaps(columns, excerpt))


def _torques():
    rubs = np.sign(np.gradient(Q, axis=0))  # in one row
    return 5 * Q[:, ::-1] + 2 * rubs + 0.02 * np.random.default_rng(1).normal(size=Q.shape)


def test_a_torque_that_leaps():
    """Of a Barrett's, by two deviations, nothing was said though half of it was left."""
    tau = _torques()
    assert not _said(tau)
    tau[1700:, 1] += 3.0
    (told,) = _said(tau)
    assert told.signals == ("tau_m2",) and told.rows == (1701, 1701) and told.hint
    assert told.message.startswith("tau_m2 leaps by ") and "at 6.8 s from one row to the next" in told.message


@pytest.mark.parametrize("way", ["back", "undone", "held", "turns", "rests", "steps"])
def test_what_leaps_by_itself(way):
    tau, q = _torques(), Q.copy()
    if way == "back":
        tau[1700:1706, 1] += 3.0
    elif way == "undone":  # as friction where the position is another joint's
        tau[1700:2000, 1] += 3.0
    elif way == "held":
        tau[1500:1700, 1] = tau[1500, 1]
    elif way == "turns":  # the other joint, whose drive this torque may be of, too
        tau[1700:, 1] += 3.0
        tau[:, 0], q[:, 0] = Q[:, 1], np.abs(T - T[1700])
    elif way == "rests":
        tau[1700:, 1] += 3.0
        q[1600:1800, 1] = q[1600, 1]
    else:
        tau = np.round(tau)
    assert not _said(tau, q)


@pytest.mark.parametrize("late", [-25, 25])
def test_dry_friction_of_a_torque_that_comes_late_leaps_as_friction_does(late):
    """By a tenth of a second: the joint has turned before, or turns after it. One turn only."""
    q = np.stack([np.abs(T - T[1700]) + 0.2 * T, 0.0 * T], axis=1)
    tau = 5 * q + 2 * np.sign(np.gradient(q, axis=0)) + 0.02 * np.random.default_rng(1).normal(size=q.shape)
    tau[:, 1] = 0.02 * np.random.default_rng(2).normal(size=len(T))
    assert not _said(np.roll(tau, late, axis=0), q)
    (told,) = _said(np.roll(-tau, late, axis=0), q)  # against the joint's way, as no friction is
    assert told.signals == ("tau_m1",)
