"""Every effect of the catalogue at every place: the linear gain of each starting shape, and a short list.

Gains are half the fall of the whitened sum of squares on the fitted rows, the model partialled out
(Frisch-Waugh-Lovell). They are taken twice, in the noise at hand and in white rows: an effect that the
noise model has swallowed (a drift) leads in white rows, one that slow noise covers leads in whitened ones.
The list is a budget of what is tried, no verdict."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.evidence.metric import Metric
from ident.diagnosis.evidence.state import State
from ident.diagnosis.rows.terms import Term
from modelgen.effects.effect import Effect
from modelgen.effects.place import Layout, Place

RATE = frozenset({"dq", "sign_dq"})
PER_METRIC = 6
PER_EFFECT = 2  # places of one effect among them: those of pairs of joints would be all there is
UNKEPT = 4e7  # bytes of columns beyond the library that wait to be scored
TOGETHER = 64  # sets of columns in one product
SHARE = 0.25  # of the best one's gain in its metric


@dataclass(frozen=True, slots=True)
class Ranked:
    """A hypothesis with its linear gain (nats). plain: it has its shape by white rows, not in the noise at
    hand: that has swallowed it and shows another."""

    term: Term
    gain: float
    plain: bool = False


class Library:
    """Columns of hypotheses, kept from step to step (float32). Those that read the model keep the one they
    were made with: they only rank here, and are made again where a hypothesis is refined."""

    def __init__(
        self,
        effects: Sequence[Effect],
        layout: Layout,
        limit_bytes: float = 6e8,
        frictionless: Collection[int] = (),
    ) -> None:
        """frictionless: joints of whose torques no law of the rate is asked."""
        self.layout = layout
        self.places = [
            (e, place)
            for e in effects
            if not e.windowed
            for place in e.places(layout)
            if not layout.covers(place.joint, e.replaces)  # its columns are the model's own, but for rounding
            and not (place.joint in frictionless and e.needs & RATE)
        ]
        self.events = [e for e in effects if e.windowed]
        self.kept: dict[tuple, dict[int, np.ndarray]] = {}
        self.room = limit_bytes
        self.begun: dict[tuple, Sequence[dict[str, float]]] = {}

    def columns(self, state: State, term: Term) -> dict[int, np.ndarray]:
        """Columns of a term at the present turn-over of its joint."""
        place = term.place
        turn = state.turns.get(place.joint) if place.joint is not None else None
        signed = "sign_dq" in term.effect.needs
        key = (*term.kind, tuple(sorted(term.theta.items())), turn if signed else None)
        if key not in self.kept:
            made = state.scene.columns(term)
            size = sum(z.size * 4 for z in made.values())
            if size > self.room:
                return made
            self.room -= size
            self.kept[key] = {c: z.astype(np.float32) for c, z in made.items()}
        return self.kept[key]


def starts(state: State, library: Library, effect: Effect, place: Place) -> Sequence[dict[str, float]]:
    """Starting shapes, told by the residual of the place's first channel; those of the whole robot are
    searched once, on the rigid model's residual."""
    if place.joint is None:
        if (effect.name, place) not in library.begun:
            library.begun[effect.name, place] = _starts(state, effect, place)
        return library.begun[effect.name, place]
    return _starts(state, effect, place)


def _starts(state: State, effect: Effect, place: Place) -> Sequence[dict[str, float]]:
    rows = place.rows(state.model.channels)
    if not rows:
        return []
    c = next(iter(rows))
    m = state.metric
    use = m.fitted.mask & state.rows.use[c]
    back = state.scene.back(c, state.residual[c], use)
    return effect.starts(place, state.motions, back, state.model)


Ranking = tuple[dict[tuple, Ranked], ...]  # of each metric: the best shape of every hypothesis


def ranked(state: State, library: Library, closed: frozenset[int]) -> Ranking:
    """Every hypothesis at its best starting shape, in the noise at hand and in white rows."""
    done = {term.key for term in state.terms}
    late = {(term.place.joint, term.place.side) for term in state.terms if term.effect.shifts_time}
    trials: list[tuple[Term, dict[int, np.ndarray]]] = []
    metrics = (state.metric, state.plain_metric)
    bests: Ranking = ({}, {})
    held = 0
    for effect, place in library.places:
        if place.joint is not None and place.joint in closed:
            continue
        if set(effect.context) - set(effect.context_of(place, state.model)):
            continue  # it is told relative to a parameter that this model does not have
        if effect.shifts_time and late & {(place.joint, place.side), (None, None), (None, place.side)}:
            continue  # it comes late once: a delay and a lag that run against each other fit anything
        for theta in starts(state, library, effect, place):
            term = Term(effect, place, theta).beside(done)
            if term.copy and not effect.nonlinear:
                continue
            columns = library.columns(state, term)
            if columns:
                trials.append((term, columns))
                held += sum(z.nbytes for z in columns.values() if z.dtype == np.float64)  # not the library's
        if held > UNKEPT:
            _weigh(metrics, trials, bests)
            trials, held = [], 0
    _weigh(metrics, trials, bests)
    return bests


def short_list(ranking: Ranking, but: Collection[int | None] = ()) -> list[Ranked]:
    """At most PER_METRIC hypotheses of each metric, one shape each, and what was left out; none of the joints
    `but`."""
    out: dict[tuple, Ranked] = {}
    for every in ranking:
        best = {key: r for key, r in every.items() if r.term.place.joint not in but}
        places: dict[str, int] = {}
        ordered = []
        for r in sorted(best.values(), key=lambda r: -r.gain):
            places[r.term.effect.name] = places.get(r.term.effect.name, 0) + 1
            if places[r.term.effect.name] <= PER_EFFECT:
                ordered.append(r)
        for r in ordered[:PER_METRIC]:
            if r.gain > SHARE * ordered[0].gain:
                out.setdefault(r.term.key, r)
        out |= {r.term.key: r for r in _contained(best, tuple(out.values())) if r.term.key not in out}
        for r in best.values():  # what the study left out is there: it is asked before what imitates it
            if r.term.effect.replaces:
                out.setdefault(r.term.key, r)
    return list(out.values())


def elsewhere(ranking: Ranking, asked: Collection[Ranked], tau: float, most: int) -> list[Ranked]:
    """The short list of the joints of which nothing was asked, where the fitted rows ask for it: one joint's
    large structure that has no name kept those of all others off the list. (Of an AIRBOT friction under load
    of joint 2, a fifth of its error, stood behind what joints 4 and 5 have.)"""
    joints = {r.term.place.joint for r in asked} | {None}
    return [r for r in short_list(ranking, joints) if r.gain > tau][:most]


def beside(
    ranking: Ranking, asked: Collection[Ranked], joint: int | None, tau: float, most: int
) -> list[Ranked]:
    """What else the fitted rows ask for on a joint, in the noise at hand or in white rows alone. (Of an arm
    0.3 of the load of joint 2 was friction, which its noise swallowed: -0.01 of a rotor's torque began there,
    and friction that follows the position led by far, with a shape at the end of its range.)"""
    out: dict[tuple, Ranked] = {}
    for plain, every in reversed(tuple(enumerate(ranking))):
        here = (r for r in every.values() if r.term.place.joint == joint and r.gain > tau)
        out |= {r.term.key: replace(r, plain=bool(plain)) for r in here}
    for r in asked:
        out.pop(r.term.key, None)
    return sorted(out.values(), key=lambda r: -r.gain)[:most]


def _contained(best: Mapping[tuple, Ranked], listed: Sequence[Ranked]) -> list[Ranked]:
    """The simpler effects that those of the list are at special values: what does not differ from them is
    theirs. (AIRBOT: friction under load that drives and brakes alike was told as one that differs.)"""
    return [r for r in best.values() if any(its.term.contains(r.term) for its in listed)]


def _weigh(
    metrics: Sequence[Metric],
    trials: Sequence[tuple[Term, dict[int, np.ndarray]]],
    bests: Ranking,
) -> None:
    """Keep the best shape of every hypothesis in each metric; the columns may go."""
    for m, best in zip(metrics, bests):
        for (term, _), gain in zip(trials, linear_gains(m, [columns for _, columns in trials], trials)):
            if gain > best.get(term.key, Ranked(term, 0.0)).gain:
                best[term.key] = Ranked(term, gain)


def linear_gains(
    m: Metric, columns: Sequence[dict[int, np.ndarray]], trials: Sequence[tuple[Term, object]]
) -> np.ndarray:
    """Gain of every set of columns alone; those of one channel together, in one product."""
    widths = [next(iter(made.values())).shape[1] for made in columns]
    cross = [np.zeros((m.fitted.basis.shape[1], p)) for p in widths]
    own, right = [np.zeros((p, p)) for p in widths], [np.zeros(p) for p in widths]
    for c in sorted({c for made in columns for c in made}):
        on = np.flatnonzero(m.fitted.mask & m.rows.use[c])
        places, values = m.X[c]
        Xb = values[on] @ m.fitted.basis[places]
        e, L = m.fitted.residual[c, on], m.whiteners[c].L[on]
        numbers = [k for k, made in enumerate(columns) if c in made]
        for begin in range(0, len(numbers), TOGETHER):
            chunk = numbers[begin : begin + TOGETHER]
            Z = L @ np.concatenate([columns[k][c] for k in chunk], axis=1, dtype=float)
            across, along = Xb.T @ Z, Z.T @ e
            at = 0
            for k in chunk:
                its = slice(at, at + widths[k])
                cross[k] += across[:, its]
                own[k] += Z[:, its].T @ Z[:, its]
                right[k] += along[its]
                at = its.stop
    products = [(o - x.T @ x, r, np.diag(o)) for o, x, r in zip(own, cross, right)]
    out = np.zeros(len(columns))
    for p in sorted(set(widths)):
        alike = [k for k, width in enumerate(widths) if width == p]
        G, g, squares = (np.stack([products[k][i] for k in alike]) for i in (0, 1, 2))
        out[alike] = _gains(G, g, squares, [trials[k][0] for k in alike])
    return out


def _gains(G: np.ndarray, right: np.ndarray, own: np.ndarray, terms: Sequence[Term]) -> np.ndarray:
    """(K,) half of g' G^-1 g, of (K, p, p) and (K, p); zero where physics forbids the sign or the model holds
    the columns already."""
    scale = np.sqrt(np.maximum(own, 1e-300))
    A = G / (scale[:, :, None] * scale[:, None, :])
    sound = np.isfinite(A).all(axis=(1, 2)) & (np.diagonal(A, axis1=1, axis2=2).min(axis=1) >= 1e-6)
    values, vectors = np.linalg.eigh(np.where(sound[:, None, None], A, np.eye(A.shape[1])))
    h = np.einsum("kij,ki->kj", vectors, right / scale)
    parts = np.where(values > 1e-6, h / np.where(values > 1e-6, values, 1.0), 0.0)
    gains = np.where(sound, 0.5 * np.sum(h * parts, axis=1), 0.0)
    sizes = np.einsum("kij,kj->ki", vectors, parts) / scale
    for k in np.flatnonzero(gains > 0).tolist():
        term = terms[k]
        told = dict(zip(term.effect.parameters_of(term.place), sizes[k]))
        if term.effect.physical({**term.theta, **told}) is not None:
            gains[k] = 0.0
    return gains


def with_size(term: Term, sizes: np.ndarray) -> Term:
    return replace(term, size=tuple(float(x) for x in sizes))
