"""Recordings in which dry friction may turn over in any way, beside what the model says of it.

Where a joint turns, dry friction gives way over a travel or over a rate that nobody knows, and what it does
there looks like a torque that comes late, or like one of another joint. So columns are put beside each
torque's own that vanish away from its joint's turns: friction's sign times an exponential of the travel since
the last turn, and of the rate, of several sizes each.
"""

from __future__ import annotations

import numpy as np

from ident.examination.fits.quick import Quick
from ident.examination.fits.samples import Sample

SHARES = 10.0 ** np.arange(-3.0, 0.0, 0.5)  # of a joint's whole travel, and of its usual rate


def with_any_turn_over(quick: Quick) -> Quick:
    """The same where the torque of each joint has what its turns may do."""
    joints = sorted(set(quick.columns.joint_of))
    every = np.concatenate([s.q for s in quick.samples])
    travel = np.ptp(every, axis=0)
    rate = np.sqrt(np.mean(np.concatenate([s.dq for s in quick.samples]) ** 2, axis=0))
    own = np.array(quick.columns.joint_of, int)[:, None, None] == np.array(joints)[:, None, None, None]

    def beside(s: Sample) -> Sample:
        turns = np.stack([_turns(s, j, travel[j], rate[j]) for j in joints])  # (joints, N, p)
        return s.beside(np.concatenate(list(own * turns[:, None]), axis=2))

    return quick.of([beside(s) for s in quick.samples])


def _turns(s: Sample, joint: int, travel: float, rate: float) -> np.ndarray:
    """(N, p) of one joint; nothing before its first turn is known of the travel."""
    sign, speed = s.thin.sign_dq[:, joint, None], np.abs(s.dq[:, joint, None])
    if not (travel > 0 and rate > 0):
        return np.zeros((len(sign), 2 * len(SHARES)))
    past = _travelled(s, joint)[:, None]
    return np.asarray(sign * np.exp(-np.hstack([past / (SHARES * travel), speed / (SHARES * rate)])))


def _travelled(s: Sample, joint: int) -> np.ndarray:
    """(N,) rad | m since the joint turned last; infinite before it has turned."""
    q, dq, t = s.q[:, joint], s.dq[:, joint], s.t
    k = np.flatnonzero(dq[:-1] * dq[1:] < 0)
    share = dq[k] / (dq[k] - dq[k + 1])
    at = q[k] + 0.5 * dq[k] * share * (t[k + 1] - t[k])  # the rate falls to nothing there
    last = np.searchsorted(k + 1, np.arange(len(q)), side="right")
    return np.asarray(np.abs(q - np.append(np.inf, at)[last]))
