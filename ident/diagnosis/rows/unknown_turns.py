"""What is not known of a reversal: where a joint turned is known no better than its positions, and what its
dry friction did before a recording begins is not known at all.

A turn a little before or after puts another share of Fc under the samples that follow, by

    exp(-|q - q_k| / travel)   of a friction that gives way,   1 - |sign|   of one that does not

of the k-th turn: one torque a turn, whose size nobody knows. (An encoder's steps of 7 urad beside a travel of
42 were 5 % of a Franka's friction at each turn, and 350 nats of structure in an arm that had none.)"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ident.equations.fine import FineSegment
from ident.signals.dry_friction import TurnOver
from modelgen.effects.states import reversals

LEAST = 0.01  # of a turn's torque: rows that see less of it do not see it


def unknown_turns(segments: Sequence[FineSegment], joint: int, turn: TurnOver) -> np.ndarray:
    """(M, K) torques of size one of the turns of a joint whose friction turns over so, and of what each
    stretch begins with; those that no row sees are left out."""
    return _decimated(segments, [_of_stretch(s, joint, turn) for s in segments], joint)


def late_turns(segments: Sequence[FineSegment], joint: int, late: float) -> np.ndarray:
    """(M, K) what each turn of a joint leaves in the torque where it is felt so much later [s], of a friction
    of size one."""
    made = []
    for s in segments:
        sign = s.sign_dq[:, joint]
        change = np.interp(s.t - late, s.t, sign) - sign
        felt = np.abs(change) > LEAST
        made.append(_each(s, joint, np.cumsum(felt & ~np.append(False, felt[:-1])), change))
    return _decimated(segments, made, joint)


def _decimated(segments: Sequence[FineSegment], fine: Sequence[np.ndarray], joint: int) -> np.ndarray:
    """(M, K) of columns (N, k) of each stretch, which no other has."""
    parts = [s.decimate(z, joint) for s, z in zip(segments, fine)]
    ends = np.cumsum([p.shape[1] for p in parts])
    out = [np.zeros((len(p), ends[-1])) for p in parts]
    for rows, p, end in zip(out, parts, ends):
        rows[:, end - p.shape[1] : end] = p
    return np.concatenate(out)


def _of_stretch(s: FineSegment, joint: int, turn: TurnOver) -> np.ndarray:
    """(N, K) on the fine samples."""
    q, speed = s.q[:, joint], s.speed[:, joint]
    if turn.travel > 0:
        starts = reversals(q)
        number = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(q))))
        size = np.exp(-np.abs(q - q[starts[number]]) / turn.travel)
    else:
        turned = np.flatnonzero(speed[1:] * speed[:-1] <= 0) + 1
        starts = np.append(0, (turned[1:] + turned[:-1]) // 2)
        number = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(q))))
        size = 1 - np.abs(turn.direct(speed, s.rate_hz))
    return _each(s, joint, number, size)


def _each(s: FineSegment, joint: int, number: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """(N, K) a torque (N,) turn by turn, of the number (N,) that each sample has; without turns that no
    sample sees."""
    seen = np.unique(number[(np.abs(torque) > LEAST) & (s.certain[:, joint] > 0)])
    return np.asarray(np.where(number[:, None] == seen, torque[:, None], 0.0))
