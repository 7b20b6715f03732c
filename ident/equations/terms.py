"""Placed effects as columns of a study's equations: at one point of their parameters, and linear about it.

A term's torque is F(x) = T(theta, a) a, x = (a, theta): linear parameters a, shape parameters theta. About x0

    Y - F(x0) + J x0 = W chi + J x + rho,     J = dF/dx (T itself where F is linear in a)

is one more set of linear equations, whose unknowns are the parameters themselves: least squares, standard
deviations, F-tests and Huber weights need know nothing of effects. Columns are made of the filtered blocks,
with as much motion either side as an effect asks for, and pass through the decimation that the rows have
passed through.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ident.equations.columns import Columns
from ident.equations.fitted import FittedModel
from modelgen.geometry.names import unit_of
from modelgen.geometry.place import Motion, Place

if TYPE_CHECKING:  # importing effects imports SymPy, which a study without them does not need
    from modelgen.effects.effect import Effect, LinearParameter, NonlinearParameter
    from modelgen.geometry.robot import Robot

STEP = 1e-5  # of differences over parameters, relative
PROBE = 64  # samples on which linearity in the size is seen
Memory = dict[Any, Any]


@dataclass(frozen=True)
class Term:
    """One placed effect at a point: `size` of the linear parameters in use, `theta` of the shape parameters.

    `free` shape parameters are identified inside `bounds`; linear ones are, but for those in `known`.
    """

    label: str  # stribeck_friction:2, unique in a study
    effect: Effect
    place: Place
    theta: Mapping[str, float] = field(default_factory=dict)
    size: tuple[float, ...] = ()
    free: tuple[str, ...] = ()
    known: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def linear(self) -> tuple[str, ...]:
        """Linear parameters in use, in the order of `size` and of the columns."""
        return self.effect.parameters_of(self.place)

    @property
    def unknown(self) -> tuple[str, ...]:
        return tuple(name for name in self.linear if name not in self.known)

    @property
    def values(self) -> dict[str, float]:
        """Of the linear and the shape parameters, but for parts that are held at zero: it is told without
        them. (A cable whose own ends springs of its joints stand for gives no energy when stretched.)"""
        sizes = zip(self.linear, self.size)
        return {name: x for name, x in sizes if self.known.get(name) != 0.0} | dict(self.theta)

    def beyond(self, covariance: np.ndarray, robot: Robot) -> float:
        """Standard deviations from the nearest values that physics allows; covariance (k, k) of `names`."""
        at = [self.linear.index(name) for name in self.unknown]
        own = np.zeros((len(self.linear), len(self.linear)))
        own[np.ix_(at, at)] = covariance[: len(at), : len(at)]
        return self.effect.beyond(self.values, own, self.place, robot)

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters of the equations: unknown linear ones, then free shape parameters."""
        return tuple(f"{self.label}.{name}" for name in (*self.unknown, *self.free))

    @property
    def units(self) -> tuple[str, ...]:
        its: dict[str, LinearParameter | NonlinearParameter] = {p.name: p for p in self.effect.linear}
        its |= {p.name: p for p in self.effect.nonlinear}
        return tuple(
            self.effect.unit(its[name], self.place) if name in its else unit_of(name)
            for name in (*self.unknown, *self.free)
        )

    @property
    def at(self) -> np.ndarray:
        """x0 (p,) of `names`."""
        sizes = dict(zip(self.linear, self.size))
        return np.array([*(sizes[n] for n in self.unknown), *(self.theta[n] for n in self.free)])

    def moved(self, x: np.ndarray) -> Term:
        """The same term at other values of `names`."""
        values = dict(zip((*self.unknown, *self.free), x))
        size = tuple(float(self.known.get(name, values.get(name, 0.0))) for name in self.linear)
        return replace(self, size=size, theta={**self.theta, **{n: float(values[n]) for n in self.free}})


def plain(term: Term) -> bool:
    """Linear in its size and independent of the model: its terms are its columns."""
    from modelgen.effects.effect import Effect

    return type(term.effect).columns is Effect.columns and "tau_link" not in term.effect.needs


def with_terms(columns: Columns, terms: Sequence[Term]) -> Columns:
    """The columns of a study with the parameters of its terms behind the others."""
    names = [name for term in terms for name in term.names]
    return replace(
        columns,
        parameters=(*columns.parameters, *names),
        units=(*columns.units, *(unit for term in terms for unit in term.units)),
        regroups={**columns.regroups, **{n: term.effect.summary for term in terms for n in term.names}},
    )


class Placed(Protocol):
    """An effect at a place; `size`: of the linear parameters in use, where they are known."""

    @property
    def effect(self) -> Effect: ...
    @property
    def place(self) -> Place: ...
    @property
    def size(self) -> tuple[float, ...] | None: ...


def late_by(model: Columns, terms: Sequence[Placed]) -> tuple[tuple[float, ...], ...]:
    """Of each joint the seconds by which the terms have its torques recorded late, where they do."""
    seconds = np.zeros(len(model.channels))
    for term in terms:
        if term.size:
            seconds[list(term.place.rows(model.need.channels))] += term.effect.late(np.array(term.size))
    joints = range(len(model.need.joints))
    return tuple(tuple(sorted({*seconds[(model.joint_of == j) & (seconds != 0)].tolist()})) for j in joints)


def places_of(columns: Columns, terms: Sequence[Term]) -> dict[str, slice]:
    """{label: where its parameters stand} behind the b rigid ones."""
    starts = np.cumsum([len(columns.parameters), *(len(term.names) for term in terms)])
    return {term.label: slice(int(a), int(b)) for term, a, b in zip(terms, starts, starts[1:])}


@dataclass(frozen=True, slots=True)
class Tangent:
    """A term about its point on one block: (factors W + changes) chi + J x = ... with `known` on the other
    side; factors are the chain's.

    J (N, k, p) of the k `channels` and the term's p parameters; known (N, C) is F - J x0 without what changes
    of the model's own columns make of chi; changes: {parameter of the model: (N, C)}.
    """

    channels: tuple[int, ...]
    J: np.ndarray
    known: np.ndarray
    changes: Mapping[int, np.ndarray]


class Chain:
    """The terms of a model and what each sees of the others: those that act before it (a recorder acts last).

    One pass over the recordings uses one of these, since states go on from block to block; what the model
    answers is kept of one block (`forget`).
    """

    def __init__(self, model: FittedModel, terms: Sequence[Term]) -> None:
        self._answers: dict[Any, Any] = {}
        self.model, self.terms = replace(model, kept=self._answers), tuple(terms)
        self.seen = {term.label: self._seen(term) for term in terms}
        self._memories: dict[tuple[object, ...], Memory] = {}
        self._last: tuple[Motion | None, dict[str, np.ndarray]] = (None, {})

    def memory(self, *key: object) -> Memory:
        return self._memories.setdefault(key, {})

    def forget(self) -> None:
        """What was kept of a block that is done."""
        self._answers.clear()

    def torque(self, motion: Motion, terms: Sequence[Term] | None = None) -> np.ndarray:
        """(N, C) of some of the terms, by default all; each is computed once a block."""
        if self._last[0] is not motion:
            self._last = (motion, {})
        out = np.zeros((len(motion.t), len(self.model.channels)))
        for term in self.terms if terms is None else terms:
            if term.label not in self._last[1]:
                memory = self.memory(term.label)
                self._last[1][term.label] = torque_of(term, motion, self.seen[term.label], memory)
            out += self._last[1][term.label]
        return out

    def factors(self, before: Term | None = None) -> np.ndarray:
        """(C,) by which later terms multiply a term in each channel; None: by which all do the model."""
        out = np.ones(len(self.model.channels))
        for term in self.terms:
            if before is None or _stage(term) > _stage(before):
                out[list(term.place.rows(self.model.channels))] *= term.effect.factor(np.array(term.size))
        return out

    def _seen(self, term: Term) -> FittedModel:
        earlier = [other for other in self.terms if _stage(other) < _stage(term)]
        if not earlier:
            return self.model
        return replace(self.model, before=lambda motion: self.torque(motion, earlier))


def torque_of(term: Term, motion: Motion, model: FittedModel, memory: Memory) -> np.ndarray:
    """F (N, C) of a term at its point."""
    out = np.zeros((len(motion.t), len(model.channels)))
    size = np.array(term.size)
    for channel, columns in term.effect.columns(term.place, term.theta, size, motion, model, memory).items():
        out[:, channel] += columns @ size
    if term.effect.changes_model:
        out += term.effect.torque_change(term.place, term.theta, motion, model, model.chi)
    return out


def tangent(term: Term, motion: Motion, chain: Chain) -> Tangent:
    """A term about its point, the other terms of the chain as they are."""
    model, size = chain.seen[term.label], np.array(term.size)
    memory = chain.memory(term.label, "columns")
    columns = term.effect.columns(term.place, term.theta, size, motion, model, memory)
    changes = _changes(term, motion, model)
    count = len(model.channels)
    channels = tuple(range(count)) if changes or term.effect.changes_model else tuple(sorted(columns))

    J = np.zeros((len(motion.t), len(channels), len(term.names)))
    known = np.zeros((len(motion.t), count))
    for channel, found in columns.items():
        known[:, channel] = found @ size
        J[:, channels.index(channel), : len(term.unknown)] = found[
            :, [n in term.unknown for n in term.linear]
        ]
    here = known.copy()
    for number, change in changes.items():
        here += model.chi[number] * change
    beside = [(k, name, _other_shape) for k, name in enumerate(term.free, len(term.unknown))]
    if _bent(term, motion, model):
        beside += [(k, name, _other_size) for k, name in enumerate(term.unknown)]
    for k, name, other in beside:
        its, step = other(term, name)
        torque = torque_of(its, motion, model, chain.memory(term.label, name))
        J[:, :, k] = (torque - here)[:, channels] / step
    known[:, channels] -= J @ term.at
    its_factor = term.effect.factor(size)
    if its_factor != 1.0:  # what it makes of all before it stands in their columns
        known[:, channels] -= (its_factor - 1.0) * model.total(motion)[:, channels]
    later = chain.factors(term)
    return Tangent(channels, J * later[list(channels), None], known * later, changes)


def _changes(term: Term, motion: Motion, model: FittedModel) -> Mapping[int, np.ndarray]:
    if not term.effect.changes_model:
        return {}
    return term.effect.regressor_change(term.place, term.theta, motion, model)


def _bent(term: Term, motion: Motion, model: FittedModel) -> bool:
    """Whether the columns change with the size: the term is not linear in it. What acts before it is not
    asked: states that go on from block to block would go on from these samples."""
    size = np.array(term.size)
    if term.effect.state is not None or not size.any():
        return False
    few, model = replace(motion.only(slice(PROBE)), measured=None), replace(model, before=None)
    one, other = (
        term.effect.columns(term.place, term.theta, times * size, few, model, {}) for times in (1.0, 1.3)
    )
    return any(not np.array_equal(one[channel], other[channel]) for channel in one)


def _other_size(term: Term, name: str) -> tuple[Term, float]:
    """A point beside the term's, and how far."""
    k = term.linear.index(name)
    h = STEP * max(abs(term.size[k]), 1e-3)
    return replace(term, size=(*term.size[:k], term.size[k] + h, *term.size[k + 1 :])), h


def _other_shape(term: Term, name: str) -> tuple[Term, float]:
    low, high = term.bounds.get(name, (-np.inf, np.inf))
    here = term.theta[name]
    h = STEP * max(abs(here), 1e-3 * (high - low) if np.isfinite(high - low) else 1e-3)
    h = h if here + h <= high else -h
    return replace(term, theta={**term.theta, name: here + h}), h


def _stage(term: Term) -> int:
    from modelgen.effects.truth import STAGES

    return STAGES.index(term.effect.stages(term.place)[0])
