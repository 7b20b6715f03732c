"""By how much a torque steps where a joint turns round: its dry friction, and every effect found that is a
multiple of the same sign.

The width within which that sign turns over is one for all of them. Sought beside columns that have the old
one, it stays near it or swings from round to round: of a friction under load of 0.3 it went from 0.2 to
9 mrad/s and back, and a Stribeck friction stood for what was wrong."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.rows.terms import Term
from modelgen.effects.effect import Effect
from modelgen.effects.place import Model, Motion


@dataclass(frozen=True, eq=False)
class Stepped:
    """The torque that a joint's sign makes in a channel, of any size: heights [(N,) of a stretch, ...]."""

    heights: Sequence[np.ndarray]

    def __call__(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        return [height * sign for height, sign in zip(self.heights, parts)]

    @property
    def key(self) -> Hashable:
        return self


def multiplies_sign(term: Term | None, joint: int) -> bool:
    """Whether an effect's torque is one of the joint's sign as it is at that instant. (What the study left
    out turns over by itself, and what has a memory has a travel of its own.)"""
    if term is None or term.place.joint != joint or term.effect.replaces:
        return False
    its = type(term.effect)
    instant = its.columns is Effect.columns and its.states is Effect.states and not term.effect.state
    return instant and "sign_dq" in term.effect.needs


def steps(term: Term, motion: Motion, model: Model) -> dict[int, np.ndarray]:
    """{channel: (N, p)} of its columns what the sign multiplies."""
    joint, ends = term.place.joint, []
    for sign in (1.0, -1.0):
        signs = motion.sign_dq.copy()
        signs[:, joint] = sign
        one = replace(motion, sign_dq=signs)
        ends.append(term.effect.columns(term.place, term.theta, None, one, model, {}))
    return {c: (z - ends[1][c]) / 2 for c, z in ends[0].items()}
