"""Dry friction's smoothed signs as columns of the rows: of one joint, within many widths at once."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import lru_cache
from typing import Protocol

import numpy as np

from ident.diagnosis.rows.rows import Rows
from ident.equations.fine import FineSegment
from ident.signals.dry_friction import TurnOver, slid


class How(Protocol):
    """What is recorded of a joint's sign in a channel: [(N,) of a stretch, ...] -> the same, and what it is a
    matter of."""

    def __call__(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]: ...
    @property
    def key(self) -> Hashable: ...


Signs = Callable[[TurnOver], list[np.ndarray]]  # of one joint: (N,) smoothed sign of each stretch


def signs_of(segments: Sequence[FineSegment], joint: int, kept: int = 2) -> Signs:
    """A joint's smoothed signs; what only one of the widths enters is kept while the other one is sought, of
    so many widths."""

    @lru_cache(maxsize=kept)
    def direct(rate: float, instant: bool) -> list[np.ndarray]:
        turn = TurnOver(rate, instant=instant)
        return [turn.direct(s.speed[:, joint], s.rate_hz) for s in segments]

    @lru_cache(maxsize=kept)
    def state(travel: float) -> list[np.ndarray]:
        turn = TurnOver(0.0, travel)
        return [turn.state(s.q[:, joint], s.speed[:, joint], s.rate_hz) for s in segments]

    def made(turn: TurnOver) -> list[np.ndarray]:
        if turn.travel <= 0:
            return direct(turn.rate, turn.instant)
        if turn.rate <= 0:
            return state(turn.travel)
        return [slid(z, x) for z, x in zip(state(turn.travel), direct(turn.rate, turn.instant))]

    return made


class SignColumns:
    """Smoothed signs of one motion, kept as they are and as decimated columns (M,), the latest of them: a
    later search tries the widths of an earlier one again, three times out of four."""

    def __init__(self, limit_bytes: float = 1e7) -> None:
        self.limit = limit_bytes
        self.motion: tuple[np.ndarray, ...] = ()
        self.signs: dict[int, Signs] = {}
        self.kept: dict[tuple[int, Hashable, TurnOver], np.ndarray] = {}

    def columns(
        self, segments: Sequence[FineSegment], joint: int, turns: Sequence[TurnOver], record: How | None
    ) -> np.ndarray:
        """(M, turns)"""
        signs, how = self._signs(segments, joint), None if record is None else record.key
        keys = [(joint, how, turn) for turn in turns]
        new = [key for key in dict.fromkeys(keys) if key not in self.kept]
        if new:
            made = _decimated(segments, joint, [signs(turn) for *_, turn in new], record)
            self.kept |= zip(new, np.ascontiguousarray(made.T))
        for key in dict.fromkeys(keys):
            self.kept[key] = self.kept.pop(key)  # the latest are last
        out = np.stack([self.kept[key] for key in keys], axis=1)
        for key in list(self.kept)[: -int(self.limit / out[:, 0].nbytes) or None]:
            del self.kept[key]
        return out

    def _signs(self, segments: Sequence[FineSegment], joint: int) -> Signs:
        motion = tuple(s.q for s in segments)
        if len(motion) != len(self.motion) or any(q is not its for q, its in zip(motion, self.motion)):
            self.motion, self.signs, self.kept = motion, {}, {}
        if joint not in self.signs:
            each = 2 * sum(q.nbytes for q in motion)  # of all joints, by each of the widths
            self.signs[joint] = signs_of(segments, joint, max(2, int(2 * self.limit / each)))
        return self.signs[joint]


def sign_columns(
    segments: Sequence[FineSegment],
    rows: Rows,
    joint: int,
    channel: int,
    turns: Sequence[TurnOver],
    record: How | None = None,
    kept: SignColumns | None = None,
) -> np.ndarray:
    """(M, turns) decimated smoothed signs; record: how one is recorded, where the torque comes late."""
    if kept is not None:
        return kept.columns(segments, joint, turns, record) * rows.scale[channel][:, None]
    signs = signs_of(segments, joint)
    return _decimated(segments, joint, map(signs, turns), record) * rows.scale[channel][:, None]


def sign_column(
    segments: Sequence[FineSegment],
    rows: Rows,
    joint: int,
    channel: int,
    turn: TurnOver,
    record: How | None = None,
) -> np.ndarray:
    """(M,) of one turn-over."""
    return sign_columns(segments, rows, joint, channel, [turn], record)[:, 0]


def _decimated(
    segments: Sequence[FineSegment],
    joint: int,
    signs: Iterable[Sequence[np.ndarray]],
    record: How | None,
) -> np.ndarray:
    """(M, k) of k signs (N,) of each stretch, as they are recorded."""
    each = zip(segments, zip(*(signs if record is None else map(record, signs))))
    return np.concatenate([s.decimate(np.array(parts).T, joint) for s, parts in each])
