"""What is recorded of dry friction's sign where the torque comes late or smoothed.

A delay and the width within which friction turns over are sought in turn; a width that is sought beside a
sign that is not late takes the delay's place, and none of the two finds back. So the sign is late, too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import cast

import numpy as np

from ident.diagnosis.terms import Term
from modelgen.effects.place import Model, Motion
from modelgen.geometry.names import Channel

Record = Callable[[Sequence[np.ndarray]], list[np.ndarray]]  # [(N,) of a stretch, ...] as it is recorded


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


def recorders(
    terms: Sequence[Term], channels: Sequence[Channel], motions: Sequence[Motion]
) -> Mapping[int, Record]:
    """Of each channel whose torque comes late how it is recorded; the others are recorded as they are."""
    late = [(term, term.place.rows(channels)) for term in terms if comes_late(term)]
    of = {c: [term for term, rows in late if c in rows] for c in range(len(channels))}
    return {c: partial(_recorded, own, channels[c], motions) for c, own in of.items() if own}


def _recorded(
    late: Sequence[Term], channel: Channel, motions: Sequence[Motion], parts: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """One channel's torque (N,) of every stretch after these terms, one after the other."""
    memories: list[dict] = [{} for _ in late]
    out = []
    for values, motion in zip(parts, motions):
        for term, memory in zip(late, memories):
            size = np.array(term.size)
            model = cast(Model, _Torque((channel,), values))
            made = term.effect.columns(term.place, term.theta, size, motion, model, memory)
            values = values + made[0] @ size
        out.append(values)
    return out
