"""What is recorded of dry friction's sign where the torque comes late or smoothed.

A delay and the width within which friction turns over are sought in turn; a width that is sought beside a
sign that is not late takes the delay's place, and none of the two finds back. So the sign is late, too."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from ident.diagnosis.rows.terms import Term
from modelgen.effects.place import Model, Motion
from modelgen.geometry.names import Channel


@dataclass(frozen=True, slots=True)
class _Torque:
    """A model whose torque in every channel is one signal (N,)."""

    channels: Sequence[Channel]
    values: np.ndarray

    def total(self, motion: Motion) -> np.ndarray:
        return np.broadcast_to(self.values[:, None], (len(self.values), len(self.channels)))


def comes_late(term: Term) -> bool:
    """Whether a term moves or smooths the torque in time as it is recorded."""
    return term.effect.kind == "measurement" and term.effect.shifts_time and term.size is not None


@dataclass(frozen=True)
class Record:
    """How the torque of a channel is recorded: `late`, one term after the other, over these stretches."""

    late: tuple[Term, ...]
    channel: Channel
    motions: Sequence[Motion]

    def __call__(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """[(N,) of a stretch, ...] as it is recorded."""
        memories: list[dict] = [{} for _ in self.late]
        out = []
        for values, motion in zip(parts, self.motions):
            for term, memory in zip(self.late, memories):
                size = np.array(term.size)
                model = cast(Model, _Torque((self.channel,), values))
                made = term.effect.columns(term.place, term.theta, size, motion, model, memory)
                values = values + made[0] @ size
            out.append(values)
        return out

    @property
    def key(self) -> Hashable:
        """What it is a matter of, of one motion: time alone moves."""
        return tuple((term.key, tuple(sorted(term.theta.items())), term.size) for term in self.late)


def recorders(
    terms: Sequence[Term], channels: Sequence[Channel], motions: Sequence[Motion]
) -> Mapping[int, Record]:
    """Of each channel whose torque comes late how it is recorded; the others are recorded as they are."""
    late = [(term, term.place.rows(channels)) for term in terms if comes_late(term)]
    of = {c: tuple(term for term, rows in late if c in rows) for c in range(len(channels))}
    return {c: Record(own, channels[c], motions) for c, own in of.items() if own}
