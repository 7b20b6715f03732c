"""Dry friction's smoothed signs as columns of the rows: of one joint, within many widths at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache

import numpy as np

from ident.diagnosis.fine import FineSegment
from ident.diagnosis.recorded import Record
from ident.diagnosis.rows import Rows
from ident.signals.dry_friction import TurnOver, mean_sign, slid

Signs = Callable[[TurnOver], list[np.ndarray]]  # of one joint: (N,) smoothed sign of each stretch


def signs_of(segments: Sequence[FineSegment], joint: int) -> Signs:
    """A joint's smoothed signs; what only one of the widths enters is kept while the other one is sought."""

    @lru_cache(maxsize=2)
    def direct(rate: float) -> list[np.ndarray]:
        return [mean_sign(s.speed[:, joint], rate) for s in segments]

    @lru_cache(maxsize=2)
    def state(travel: float) -> list[np.ndarray]:
        turn = TurnOver(0.0, travel)
        return [turn.state(s.q[:, joint], s.speed[:, joint]) for s in segments]

    def made(turn: TurnOver) -> list[np.ndarray]:
        if turn.travel <= 0:
            return direct(turn.rate)
        return [slid(z, x) for z, x in zip(state(turn.travel), direct(turn.rate))]

    return made


class SignColumns:
    """Decimated smoothed signs (M,) of one motion, kept: a later search tries the widths of an earlier one
    again, three times out of four."""

    def __init__(self, limit_bytes: float = 1e7) -> None:
        self.limit = self.room = limit_bytes
        self.motion: tuple[np.ndarray, ...] = ()
        self.kept: dict[tuple[int, TurnOver], np.ndarray] = {}

    def columns(
        self, segments: Sequence[FineSegment], joint: int, turns: Sequence[TurnOver], signs: Signs
    ) -> np.ndarray:
        """(M, turns)"""
        motion = tuple(s.q for s in segments)
        if len(motion) != len(self.motion) or any(q is not its for q, its in zip(motion, self.motion)):
            self.motion, self.kept, self.room = motion, {}, self.limit
        new = [turn for turn in turns if (joint, turn) not in self.kept]
        made = dict(zip(new, _decimated(segments, joint, map(signs, new)).T if new else ()))
        for turn, column in made.items():
            if column.nbytes <= self.room:
                self.room -= column.nbytes
                self.kept[joint, turn] = column.copy()
        return np.stack([made[t] if t in made else self.kept[joint, t] for t in turns], axis=1)


def sign_columns(
    segments: Sequence[FineSegment],
    rows: Rows,
    joint: int,
    channel: int,
    turns: Sequence[TurnOver],
    record: Record | None = None,
    signs: Signs | None = None,
    kept: SignColumns | None = None,
) -> np.ndarray:
    """(M, turns) decimated smoothed signs; record: what is recorded of one, where the torque comes late."""
    signs = signs or signs_of(segments, joint)
    if record is None and kept is not None:
        made = kept.columns(segments, joint, turns, signs)
    else:
        each = map(signs, turns)
        made = _decimated(segments, joint, each if record is None else map(record, each))
    return made * rows.scale[channel][:, None]


def sign_column(
    segments: Sequence[FineSegment],
    rows: Rows,
    joint: int,
    channel: int,
    turn: TurnOver,
    record: Record | None = None,
) -> np.ndarray:
    """(M,) of one turn-over."""
    return sign_columns(segments, rows, joint, channel, [turn], record)[:, 0]


def _decimated(
    segments: Sequence[FineSegment], joint: int, signs: Iterable[Sequence[np.ndarray]]
) -> np.ndarray:
    """(M, k) of k signs (N,) of each stretch."""
    each = zip(segments, zip(*signs))
    return np.concatenate([s.decimate(np.array(parts).T, joint) for s, parts in each])
