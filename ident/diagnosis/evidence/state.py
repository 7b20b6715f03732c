"""The model with everything found so far on the fitted rows: estimate, noise, turn-over of friction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np

from ident.diagnosis.evidence.metric import Metric, acting, metric, orthonormal, stacked
from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.rows.signs import SignColumns
from ident.diagnosis.rows.terms import Scene, Term, columns_of
from ident.diagnosis.rows.turn_over import Dry, TurnOver
from ident.diagnosis.rows.whitened import Whitener
from ident.equations.columns import Columns
from ident.equations.fine import FineSegment
from ident.equations.fitted import FittedModel
from modelgen.effects.place import Motion
from modelgen.geometry.robot import Robot


class Source(Protocol):
    """What rows and fine signals come from (opening.py)."""

    def with_late(self, seconds: Sequence[Sequence[float]]) -> Source: ...
    def read(self) -> tuple[Rows, tuple[FineSegment, ...]]: ...


@dataclass(frozen=True)
class Problem:
    """What does not change while effects are looked for; `source` does where a torque is found to come
    late. asked: effects at places that may be told of this robot."""

    robot: Robot
    columns: Columns
    dry: tuple[Dry, ...]
    asked: int
    source: Source | None = field(default=None, compare=False)
    signs: SignColumns = field(default_factory=SignColumns, compare=False)


@dataclass(frozen=True)
class Found:
    """Columns in the model: of a term, or (term None) of a function without a name of these signals."""

    term: Term | None
    columns: Mapping[int, np.ndarray]
    sizes: np.ndarray
    variables: tuple[str, ...] = ()


@dataclass(frozen=True)
class State:
    problem: Problem
    rows: Rows
    segments: tuple[FineSegment, ...]
    motions: tuple[Motion, ...]
    turns: Mapping[int, TurnOver]
    found: tuple[Found, ...]
    whiteners: tuple[Whitener, ...]
    beta: np.ndarray  # (B,) model, then found

    @cached_property
    def design(self) -> tuple[tuple[tuple[np.ndarray, np.ndarray], ...], int]:
        return stacked(self.rows, [f.columns for f in self.found])

    @cached_property
    def metric(self) -> Metric:
        design, B = self.design
        return metric(self.rows, design, B, self.whiteners)

    @cached_property
    def plain_metric(self) -> Metric:
        """The same rows as if their noise were white."""
        design, B = self.design
        return metric(self.rows, design, B, self.plain_whiteners, slow=False)

    @cached_property
    def plain_whiteners(self) -> list[Whitener]:
        """Of each channel as if its noise were white, as loud as what is left there."""
        plain = []
        for c, use in enumerate(self.rows.use):
            counted = use & self.rows.fitted
            left = float(np.sqrt(np.mean(self.residual[c, counted] ** 2))) if counted.any() else 1.0
            plain.append(Whitener.white(use, max(left, 1e-12)))
        return plain

    @cached_property
    def residual(self) -> np.ndarray:
        """(C, M) unwhitened, of all used rows, frozen at the estimate."""
        design, _ = self.design
        rho = [self.rows.Y[c] - values @ self.beta[places] for c, (places, values) in enumerate(design)]
        return np.where(self.rows.use, np.stack(rho), 0.0)

    @cached_property
    def noise(self) -> np.ndarray:
        """(C, M) residual that is taken for noise: on the judged rows that of their own fit."""
        design, B = self.design
        beta = weighted_fit(self.rows, design, B, self.rows.judged)
        own = np.stack([self.rows.Y[c] - values @ beta[places] for c, (places, values) in enumerate(design)])
        return np.where(self.rows.use & self.rows.judged, own, self.residual)

    @cached_property
    def model(self) -> FittedModel:
        before = partial(added, self._rigid, self.found, self.rows.channels)  # of values: no reference circle
        return replace(self._rigid, before=before, kept={})

    @cached_property
    def _rigid(self) -> FittedModel:
        vs = {segment.label: segment.vs for segment in self.segments}
        return FittedModel(self.problem.columns, self.problem.robot, self.beta[: self.rows.b], vs)

    @cached_property
    def scene(self) -> Scene:
        beside = partial(beside_factor, replace(self), self.design)  # nothing that the state keeps: no circle
        return Scene(self.rows, self.segments, self.motions, self.model, beside)

    def plus(self, *found: Found) -> State:
        """With more in it, not settled yet."""
        return replace(self, found=(*self.found, *found))

    def coefficients(self, number: int) -> slice:
        """Where those of one thing found stand, behind the model's and those before it."""
        begin = self.rows.b + sum(len(f.sizes) for f in self.found[:number])
        return slice(begin, begin + len(self.found[number].sizes))

    def but(self, number: int) -> State:
        """Without one thing found, not settled yet."""
        return replace(self, found=tuple(f for k, f in enumerate(self.found) if k != number))

    def swapped(self, number: int, other: Found) -> State:
        """With another in the place of one thing found, not settled yet."""
        return replace(self, found=tuple(other if k == number else f for k, f in enumerate(self.found)))

    def begins(self, recording: str | None) -> float:
        """First stamp of a recording [s], since which its windows count: `from:` of a study counts as its
        stamps do."""
        return min(s.begun for s in self.segments if s.label == recording)

    @property
    def terms(self) -> tuple[Term, ...]:
        return tuple(f.term for f in self.found if f.term is not None)


def beside_factor(
    state: State, stack: tuple[tuple[tuple[np.ndarray, np.ndarray], ...], int], term: Term
) -> FittedModel:
    """The model, with what was found, as the fitted rows have it where a term multiplies it; stack: its
    `design`."""
    design, B = stack
    own = set(term.place.rows(state.model.channels))
    scaled = [(p, v * term.factor) if c in own else (p, v) for c, (p, v) in enumerate(design)]
    beta = weighted_fit(state.rows, scaled, B, state.rows.fitted)
    return replace(state, beta=beta, found=_sized(state.found, beta, state.rows.b)).model


def added(rigid: FittedModel, found: Sequence[Found], channels: int, motion: Motion) -> np.ndarray:
    """(N, C) torque of what was found."""
    out = np.zeros((len(motion.t), channels))
    for f in found:
        if f.term is None:
            continue
        for c, z in columns_of(f.term, motion, rigid, {}).items():
            out[:, c] += z @ f.sizes
    return out


def solved(state: State) -> State:
    """Weighted least squares on the fitted rows, white within a channel as the fit's; sizes of what was found
    follow, and of what these do not show are taken from all rows. (In coloured noise a wrong model would be
    fitted to its fast part: whitening decides, it does not estimate.)"""
    rows, (design, B) = state.rows, state.design
    held = np.zeros(B, bool)
    at = rows.b
    for f in state.found:
        p = next(iter(f.columns.values())).shape[1]
        held[at : at + p] = not shown(rows, f.columns)
        at += p
    if held.any():
        every = np.where(held, weighted_fit(rows, design, B, rows.usable), 0.0)
        theirs = np.stack([values @ every[places] for places, values in design])
        others = [(places, np.where(held[places], 0.0, values)) for places, values in design]
        beta = every + weighted_fit(replace(rows, Y=rows.Y - theirs), others, B, rows.fitted)
    else:
        beta = weighted_fit(rows, design, B, rows.fitted)
    return replace(state, beta=beta, found=_sized(state.found, beta, rows.b))


def shown(rows: Rows, columns: Mapping[int, np.ndarray]) -> bool:
    """Whether fitted rows show its size: of a load on a run that judges that run's do, and one that is there
    all along the only fitted run the contrast with those that judge."""
    acts = acting(columns)
    if not (acts & rows.judged).any() and rows.held_apart:
        others = rows.fitted & rows.use.any(axis=0) & ~acts
        return bool(others.any())
    return bool((acts & rows.fitted).any())


def _sized(found: Sequence[Found], beta: np.ndarray, at: int) -> tuple[Found, ...]:
    """What was found at the sizes that an estimate beta (B,) has from `at` on."""
    out = []
    for f in found:
        p = next(iter(f.columns.values())).shape[1]
        out.append(replace(f, sizes=beta[at : at + p]))
        at += p
    return tuple(out)


def weighted_fit(
    rows: Rows, design: Sequence[tuple[np.ndarray, np.ndarray]], B: int, mask: np.ndarray
) -> np.ndarray:
    """(B,) with one noise level a channel, taken from its own residual."""
    grams, rights, powers, counts = [], [], [], []
    for c, (places, values) in enumerate(design):
        on = mask & rows.use[c]
        X, y = values[on], rows.Y[c, on]
        grams.append((places, X.T @ X))
        rights.append(X.T @ y)
        powers.append(float(y @ y))
        counts.append(max(int(on.sum()), 1))
    weight = np.array([n / max(power, 1e-300) for n, power in zip(counts, powers)])
    beta = np.zeros(B)
    for _ in range(4):
        gram, right = np.zeros((B, B)), np.zeros(B)
        for (places, G), g, w in zip(grams, rights, weight):
            gram[np.ix_(places, places)] += w * G
            right[places] += w * g
        basis = orthonormal(gram)
        beta = basis @ (basis.T @ right)
        for c, ((places, G), g) in enumerate(zip(grams, rights)):
            b = beta[places]
            left = powers[c] - 2 * g @ b + b @ G @ b
            weight[c] = counts[c] / max(left, 1e-9 * powers[c], 1e-300)
    return beta


def recolumned(state: State) -> State:
    """Columns of the terms found, made again (their signals, or the model, have changed), each on the model
    with the others: a torque is late once."""
    if not state.terms:
        return state
    found = [
        f if f.term is None else replace(f, columns=state.but(number).scene.columns(f.term))
        for number, f in enumerate(state.found)
    ]
    return replace(state, found=tuple(f for f in found if f.columns))
