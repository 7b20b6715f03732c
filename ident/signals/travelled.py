"""The path of a joint since it last turned round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Turned:
    """Where a joint last turned, where it was last, and which way it went then (0: not known yet)."""

    turn: float
    last: float
    way: float


def travelled(q: np.ndarray, before: Turned | None = None, keep: int = -1) -> tuple[np.ndarray, Turned]:
    """(N,) path since the last turn along positions q (N,) that go on from `before`, from the first one on
    where there is none; and how it stands after the first `keep` of them (all: -1)."""
    begun = before or Turned(float(q[0]), float(q[0]), 0.0)
    step = np.sign(np.diff(q, prepend=begun.last))
    at = np.where(step != 0, np.arange(1, len(q) + 1), 0)
    way = np.concatenate(([begun.way], step))[np.maximum.accumulate(at)]  # at rest the way that it came
    was = np.concatenate(([begun.way], way[:-1]))
    from_ = np.concatenate(([begun.last], q[:-1]))
    turns = (way != was) & (was != 0)
    number = np.maximum.accumulate(np.where(turns, np.arange(1, len(q) + 1), 0))
    turn = np.concatenate(([begun.turn], from_))[number]
    end = keep if keep > 0 else len(q)
    return np.abs(q - turn), Turned(float(turn[end - 1]), float(q[end - 1]), float(way[end - 1]))
