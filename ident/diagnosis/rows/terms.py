"""A hypothesis as a value: an effect at a place with its shape, and the columns it makes on the rows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import count

import numpy as np

from ident.diagnosis.rows.rows import Rows
from ident.equations.fine import FineSegment
from ident.equations.fitted import FittedModel
from modelgen.effects.effect import Effect
from modelgen.effects.place import Motion, Place


@dataclass(frozen=True)
class Term:
    """A placed effect; `size` are the coefficients that secant columns are taken at, None: tangents; copy:
    which of several of its kind in one model it is."""

    effect: Effect
    place: Place
    theta: Mapping[str, float] = field(default_factory=dict)
    size: tuple[float, ...] | None = None
    copy: int = 0

    @property
    def kind(self) -> tuple:
        """Which hypothesis it is, whatever its shape."""
        p = self.place
        return (self.effect.name, p.joint, p.source, p.side, p.recording, p.link, p.parts)

    @property
    def key(self) -> tuple:
        """Which one of its kind."""
        return (*self.kind, self.copy)

    def beside(self, known: Collection[tuple]) -> Term:
        """The same as another one than those that are known by these keys."""
        free = next(k for k in count() if (*self.kind, k) not in known)
        return replace(self, copy=free)

    @property
    def optional(self) -> list[int]:
        """Places of the parameters that it may leave out; none where these are all that it has."""
        names = self.effect.parameters_of(self.place)
        rest = [k for k, name in enumerate(names) if name not in self.effect.needed]
        return rest if len(rest) < len(names) else []

    @property
    def factor(self) -> float:
        """By which it multiplies all that acts before it, where it has a size; else 1."""
        return 1.0 if self.size is None else self.effect.factor(np.array(self.size))

    @property
    def free(self) -> int:
        """Parameters that the data choose."""
        return len(self.effect.parameters_of(self.place)) + len(self.effect.bounds(self.place))

    @property
    def where(self) -> tuple[int | None, int | None, str | None]:
        """Joint, the one whose motion it is, recording."""
        return self.place.joint, self.place.source, self.place.recording

    def contains(self, other: Term) -> bool:
        """Whether it is the other one, or nearly, at special values."""
        return other.effect.name in self.effect.contains and other.where == self.where

    def at(self, **theta: float) -> Term:
        return replace(self, theta={**self.theta, **theta})


@dataclass(frozen=True)
class Scene:
    """What columns are made from: rows, their fine signals, the model at its estimate. What multiplies the
    model's torque reads it at the estimate beside that (`beside`): five times another model's torque is none
    of a torque that is five times too large."""

    rows: Rows
    segments: tuple[FineSegment, ...]
    motions: tuple[Motion, ...]
    model: FittedModel
    beside: Callable[[Term], FittedModel] | None = None

    def columns(self, term: Term) -> dict[int, np.ndarray]:
        """{channel: (M, p)} on the rows, weighted and scaled as they are; {} where it acts nowhere."""
        parts: list[dict[int, np.ndarray]] = []
        model = self.model if term.factor == 1.0 or self.beside is None else self.beside(term)
        memory: dict = {}
        p = 0
        acting: set[int] = set()
        for segment, motion in zip(self.segments, self.motions):
            if term.place.recording not in (None, segment.label):
                parts.append({})
                continue
            made = columns_of(term, motion, model, memory)
            out = {}
            for c, z in made.items():
                p = max(p, z.shape[1])
                if np.any(z):
                    out[c] = segment.decimate(z, self.model.channels[c].joint)
                    acting.add(c)
            parts.append(out)
        result = {}
        for c in sorted(acting):
            whole = [part.get(c, np.zeros((s.rows, p))) for part, s in zip(parts, self.segments)]
            result[c] = np.concatenate(whole) * self.rows.scale[c][:, None]
        return result

    def back(self, channel: int, whitened_back: np.ndarray, use: np.ndarray) -> list[np.ndarray]:
        """A row quantity (M,) of a channel at the fine samples before each row, NaN where rows do not
        count."""
        out, at = [], 0
        value = np.where(use, whitened_back, np.nan)
        for s in self.segments:
            piece = np.repeat(value[at : at + s.rows], s.every)
            at += s.rows
            out.append(np.concatenate([piece, np.full(len(s.t) - len(piece), np.nan)]))
        return out


def columns_of(
    term: Term, motion: Motion, model: FittedModel, memory: dict[object, object]
) -> dict[int, np.ndarray]:
    """{channel: (N, p)} unfiltered; for an effect that changes the model's own columns one more column:
    what the changes make of the model's parameters, so that its size is one where the term is right."""
    size = None if term.size is None else np.array(term.size)
    made = dict(term.effect.columns(term.place, term.theta, size, motion, model, memory))
    if not term.effect.changes_model:
        return made
    total = term.effect.torque_change(term.place, term.theta, motion, model, model.chi)
    p = next((z.shape[1] for z in made.values()), 0)
    none = np.zeros((len(motion.t), p))
    return {c: np.column_stack([made.get(c, none), total[:, c]]) for c in range(total.shape[1])}
