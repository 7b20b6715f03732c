"""The model with everything found so far, settled on the fitted rows: estimate, noise, turn-over of friction.

These three wait for each other and are taken in turn: least squares in the noise at hand; the noise of what
is left; the turn-over that fits best in that noise."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np

from ident.diagnosis.evidence.evidence import Metric, acting, metric, orthonormal, stacked
from ident.diagnosis.rows.recorded import Record, comes_late, recorders
from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.rows.signs import SignColumns, sign_column
from ident.diagnosis.rows.steps import Stepped, multiplies_sign, steps
from ident.diagnosis.rows.terms import Scene, Term, columns_of
from ident.diagnosis.rows.turn_over import Dry, TurnOver, settle, with_column, with_turn_overs
from ident.diagnosis.rows.whitened import Whitener, whiteners
from ident.equations.columns import Columns
from ident.equations.fine import FineSegment
from ident.equations.fitted import FittedModel
from ident.equations.terms import late_by
from modelgen.effects.place import Motion
from modelgen.geometry.robot import Robot

QUIETER = 0.9  # of what was new from row to row: dry friction is sought in all its range again
ROUNDS, CHANGE = 8, 1e-3  # of the residual, from which on columns that read the model stay as they are


class Source(Protocol):
    """What rows and fine signals come from (opening.py)."""

    def with_late(self, seconds: Sequence[Sequence[float]]) -> Source: ...
    def read(self) -> tuple[Rows, tuple[FineSegment, ...]]: ...


@dataclass(frozen=True)
class Problem:
    """What does not change while effects are looked for; `source` does where a torque is found to come
    late."""

    robot: Robot
    columns: Columns
    dry: tuple[Dry, ...]
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
        plain = []
        for c, use in enumerate(self.rows.use):
            counted = use & self.rows.fitted
            left = float(np.sqrt(np.mean(self.residual[c, counted] ** 2))) if counted.any() else 1.0
            plain.append(Whitener.white(use, max(left, 1e-12)))
        return metric(self.rows, design, B, plain, slow=False)

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


def first_state(problem: Problem, rows: Rows, segments: Sequence[FineSegment]) -> State:
    plain = tuple(Whitener.white(use) for use in rows.use)
    motions = tuple(s.motion for s in segments)
    state = State(problem, rows, tuple(segments), motions, {}, (), plain, np.zeros(rows.b))
    return settled(state, 3)


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


def settled(state: State, rounds: int = 2) -> State:
    """Estimate, noise and turn-over in turn."""
    for _ in range(rounds):
        state = solved(state)
        before = state.whiteners
        state = replace(state, whiteners=whiteners(state.rows, state.noise, state.rows.usable))
        quieter = [w.sigma < QUIETER * old.sigma for w, old in zip(state.whiteners, before)]
        state = turned(state, {state.model.channels[c].joint for c in np.flatnonzero(quieter)})
    return solved(state)


def turned(state: State, afresh: Collection[int] = (), joint: int | None = None) -> State:
    """Dry friction turns over as fits best beside everything found; on the joints `afresh` sought in all its
    range: in a louder residual another width was best, and no small step leads from it to the right one.
    joint: that of this one alone."""
    p = state.problem
    dry = tuple(d for d in (*p.dry, *_found_dry(state)) if joint in (None, d.joint))
    if not dry:
        return state
    own = fitted_alone(state)
    design, B, record = _as_recorded(own, dry)
    design, stepped = _as_stepped(own, dry, design, record)
    turns = settle(
        own.rows, design, B, own.whiteners, own.segments, dry, state.turns, afresh, {**record, **stepped},
        kept=p.signs, motion=state.segments,
    )  # fmt: skip
    if turns == state.turns:
        return state
    changed = {j: turn for j, turn in turns.items() if turn != state.turns.get(j)}
    return recolumned(replace(_turning(state, state.rows, state.segments, changed), turns=turns))


def _turning(
    state: State, rows: Rows, segments: Sequence[FineSegment], turns: Mapping[int, TurnOver]
) -> State:
    """The state on these rows and signals, the joints in `turns` turning over so. (A joint that rests, or
    goes one way, turns over nowhere.)"""
    for d in state.problem.dry:
        if d.joint in turns:
            made = {c: sign_column(segments, rows, d.joint, c, turns[d.joint]) for c, _ in d.places}
            rows = with_column(rows, d, made)
    segments = with_turn_overs(segments, turns)
    motions = tuple(s.motion for s in segments)
    return replace(state, rows=rows, segments=segments, motions=motions)


def fitted_alone(state: State) -> State:
    """Of the recordings that are fitted alone, where that is all that is asked for."""
    rows = state.rows
    fitted = np.unique(rows.recording[rows.fitted])
    chosen = np.flatnonzero(np.isin(rows.recording, fitted))
    if len(chosen) == len(rows.t):
        return state
    mine = [k for k, s in enumerate(state.segments) if s.recording in fitted]
    found = (replace(f, columns={c: z[chosen] for c, z in f.columns.items()}) for f in state.found)
    return replace(
        state,
        rows=rows.only(chosen),
        segments=tuple(state.segments[k] for k in mine),
        motions=tuple(state.motions[k] for k in mine),
        whiteners=tuple(w.only(chosen) for w in state.whiteners),
        found=tuple(found),
    )


def _as_recorded(
    state: State, dry: Sequence[Dry]
) -> tuple[Sequence[tuple[np.ndarray, np.ndarray]], int, dict[tuple[int, int], Record]]:
    """The design with dry friction's columns as they are recorded, which the columns of what comes late have
    no more part in, and how each joint's sign is recorded in the channels that come late."""
    design, B = state.design
    record = recorders(state.terms, state.model.channels, state.motions)
    if not record:
        return design, B, {}
    late: dict[int, tuple[int, float]] = {}  # of each channel the first of what comes late: its place, size
    at = state.rows.b
    for f in state.found:
        if f.term is not None and f.term.size and f.term.size[0] and comes_late(f.term):  # at 0: not yet late
            late |= {c: (at, f.term.size[0]) for c in f.columns if c not in late}
        at += next(iter(f.columns.values())).shape[1]
    made = list(design)
    for d in dry:
        turn = state.turns.get(d.joint)
        for c, place in d.places:
            if turn is None or c not in late:
                continue
            places, values = made[c][0], made[c][1].copy()
            its, (where, size) = places == place, late[c]
            sign = sign_column(state.segments, state.rows, d.joint, c, turn, record.get(c))
            values[:, places == where] -= state.beta[place] * (sign[:, None] - values[:, its]) / size
            values[:, its] = sign[:, None]
            made[c] = places, values
    return made, B, {(d.joint, c): record[c] for d in dry for c, _ in d.places if c in record}


def _as_stepped(
    state: State,
    dry: Sequence[Dry],
    design: Sequence[tuple[np.ndarray, np.ndarray]],
    late: Mapping[tuple[int, int], Record],
) -> tuple[Sequence[tuple[np.ndarray, np.ndarray]], dict[tuple[int, int], Stepped]]:
    """The design with all that a joint's sign multiplies in the columns of its dry friction, as it is at the
    estimate, where effects were found that have a part in it; and what that is. (Not where it comes late.)"""
    made, out = list(design), dict[tuple[int, int], Stepped]()
    for d, c in dict.fromkeys((its, c) for its in dry for c, _ in its.places):
        turn, joint = state.turns.get(d.joint), state.model.channels[c].joint
        asked = [
            (number, f.term)
            for number, f in enumerate(state.found)
            if f.term is not None and c in f.columns and multiplies_sign(f.term, d.joint)
        ]
        if turn is None or not asked or (d.joint, c) in late:
            continue
        own = [place for channel, place in d.places if channel == c]
        heights = [np.full(len(s.t), float(state.beta[own].sum())) for s in state.segments]
        places, values = made[c][0], made[c][1].copy()
        for number, term in asked:
            model, taken = state.but(number).model, []
            for k, (segment, motion) in enumerate(zip(state.segments, state.motions)):
                step = steps(term, motion, model)[c]
                heights[k] += step @ state.found[number].sizes
                taken.append(segment.decimate(step * motion.sign_dq[:, [d.joint]], joint))
            own_places = state.coefficients(number)
            its = (places >= own_places.start) & (places < own_places.stop)
            values[:, its] -= np.concatenate(taken) * state.rows.scale[c][:, None]
        out[d.joint, c] = Stepped(heights)
        column = sign_column(state.segments, state.rows, d.joint, c, turn, out[d.joint, c])
        values[:, np.isin(places, own)] = column[:, None]
        made[c] = places, values
    return made, out


def _found_dry(state: State) -> tuple[Dry, ...]:
    """Dry friction that a study left out and that was found: it turns over as the model's own does."""
    out, at = [], state.rows.b
    for f in state.found:
        term, p = f.term, next(iter(f.columns.values())).shape[1]
        if term is not None and term.effect.replaces and term.effect.needs == {"sign_dq"}:
            out.append(Dry(int(term.place.joint or 0), tuple((c, at) for c in f.columns)))
        at += p
    return tuple(out)


def as_late_rows(state: State) -> State:
    """The state on rows without the samples whose sign a torque as late as it was found does not tell
    (signals/filtering.py); itself where they are left out already."""
    p = state.problem
    source = None if p.source is None else p.source.with_late(late_by(p.columns, state.terms))
    if source is None or source is p.source:
        return state
    rows, segments = source.read()
    if len(rows.t) != len(state.rows.t):  # a stretch is too short to be filtered with so much beside it
        return state
    state = replace(state, problem=replace(p, source=source))
    state = converged(_turning(state, rows, segments, state.turns))
    return solved(replace(state, whiteners=whiteners(state.rows, state.noise, state.rows.usable)))


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


def converged(state: State) -> State:
    """Columns that read the model, and the model beside them, taken in turn until neither changes."""
    for _ in range(ROUNDS):
        before, state = state.residual, solved(recolumned(state))
        if np.linalg.norm(state.residual - before) < CHANGE * np.linalg.norm(state.residual):
            break
    return state


def with_found(state: State, *found: Found) -> State:
    """The state with more in it, settled again."""
    return settled(state.plus(*found), 1)


def without(state: State, number: int) -> State:
    """The state with one thing less, settled again."""
    return settled(state.but(number), 1)
