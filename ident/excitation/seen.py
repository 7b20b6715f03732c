"""What the recordings of a diagnosis say already of its suspects, two by two, and what they will say beside a
motion that is to come: the rows that judged go on judging.

Alone they leave open what the model's own parameters and the suspects have in common. Beside a motion that
settles it they tell more: T of both, with everything refitted to both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from ident.diagnosis.evidence.blocks import BLOCK_S
from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.leading import leading_metric
from ident.diagnosis.evidence.refine import Refined
from ident.diagnosis.evidence.state import State
from ident.diagnosis.rows.terms import Term as Hypothesis
from ident.diagnosis.search.settling import place_of
from ident.diagnosis.telling.deciding import SoFar
from ident.equations.terms import Term
from ident.excitation.known import ROWS_HZ, Known
from ident.excitation.separate import Imitation, Projector, imitation
from modelgen.effects.place import Motion

Array = np.ndarray
LONGEST = 60.0  # s of recordings that are looked at; the rest counts as more of the same
HZ = 50.0  # at which they are, at least
PARTS = 60  # of what they say in time, at most


def label_of(named: Mapping[str, Any]) -> str:
    """NAME:JOINT[:SOURCE] of a finding or an alternative, as a suspect's term is labelled."""
    parameters = named.get("parameters") or {}
    source = named.get("source_joint", (parameters.get("source_joint") or {}).get("value"))
    joints = list(named.get("joints") or [])[:1]
    return ":".join(map(str, (named["effect"], *joints, *([] if source is None else [source]))))


@dataclass(frozen=True)
class Seen:
    """Of two labels the nats by which the judged rows put the first ahead; the motions of these rows; of each
    label the reported parameters as the fitted rows have them."""

    ahead: Mapping[tuple[str, str], float]
    motions: Sequence[Motion]
    parameters: Mapping[str, Mapping[str, Any]]


def seen(state: State, suspects: Mapping[str, Hypothesis]) -> Seen | None:
    """Of suspects {label: term}, the first of which is in the state; None where it is not. Who is ahead is
    left open where no recording was kept apart: one that is will judge in their place."""
    first = next(iter(suspects.values()))
    number = place_of(state, first)
    if number is None:
        return None
    f, others = state.found[number], state.but(number)
    m = leading_metric(others, [Refined(first, f.columns, f.sizes, 0.0)])
    told, parameters = {}, {}
    for label, term in suspects.items():
        columns = f.columns if term is first else others.scene.columns(term)
        if columns:
            e = weigh(m, columns)
            told[label], parameters[label] = e.log_e, _reported(term, e.sizes, state)
    pairs = combinations(told, 2) if state.rows.held_apart else ()
    ahead = {(a, b): float(told[a] - told[b]) for a, b in pairs}
    judging = set(state.rows.recording[state.rows.judged].tolist())
    motions = [m for m, s in zip(state.motions, state.segments) if s.recording in judging]
    return Seen(ahead, motions, parameters)


def _reported(term: Hypothesis, sizes: Array, state: State) -> dict[str, dict[str, Any]]:
    """{name: {value, unit}}; none of what changes the model, which has no size of its own there, nor of what
    has a shape: where the data hardly see it, a law may do there what another suspect does (a Stribeck
    friction that fades in 317 s, and one that does not), and 2 h were asked to part the two."""
    effect, names = term.effect, term.effect.parameters_of(term.place)
    if effect.changes_model or effect.nonlinear or len(names) != len(sizes):
        return {}
    context = effect.context_of(term.place, state.model)
    if set(effect.context) - set(context):
        return {}
    values = {**dict.fromkeys(effect.linear_names, 0.0), **dict(zip(names, sizes.tolist())), **term.theta}
    told = effect.report(values, None, context, term.place)
    return {n: {"value": float(its["value"]), "unit": its["unit"]} for n, its in told.items()}


class Together(Projector):
    """Least squares over the base parameters along several motions at once, each of so many seconds."""

    def __init__(self, parts: Sequence[Projector], seconds: Sequence[float]) -> None:
        self.parts, last = parts, parts[-1]
        self.known, self.motion, self.sigma = last.known, last.motion, last.sigma
        self.scale = [np.sqrt(ROWS_HZ * s / part.instants) for part, s in zip(parts, seconds)]
        self.solve(np.concatenate([scale * part.W for scale, part in zip(self.scale, parts)]))

    def torque(self, term: Term) -> Array:
        return np.concatenate([scale * part.torque(term) for scale, part in zip(self.scale, self.parts)])

    def columns(self, term: Term) -> Array:
        return np.concatenate([scale * part.columns(term) for scale, part in zip(self.scale, self.parts)])


class Recordings:
    """Motions that were recorded, as suspects show in them; at most LONGEST seconds in detail."""

    def __init__(self, known: Known, motions: Sequence[Motion], sigma: Array) -> None:
        lengths = [len(m.t) / float(m.rate_hz) for m in motions]
        self.seconds, taken = sum(lengths), 0.0
        self.parts: list[Projector] = []
        for motion, length in zip(motions, lengths):
            if taken < LONGEST:
                part = _thinned(motion, min(length, LONGEST - taken))
                self.parts.append(Projector(known, part, sigma))
                taken += len(part.t) / part.rate_hz
        each = [len(p.motion.t) / p.motion.rate_hz for p in self.parts]
        self.each = [its * self.seconds / taken for its in each]

    def beside(self, designed: Projector, pair: tuple[Term, Term], both: Sequence[Imitation]) -> SoFar:
        """What they say of two suspects, without who is ahead, beside one period of a motion on which each
        imitates the other as in `both`."""
        alone = Together(self.parts, self.each)
        joint = Together([*self.parts, designed], [*self.each, both[0].period])
        rates, T = [], []
        for term, its in zip(pair, both):
            T.append(float(np.sum(imitation(alone, term, its.other, warm=True).residual ** 2)))
            left = imitation(joint, term, its.other, warm=True).residual[: alone.instants]
            count = int(np.clip(self.seconds / BLOCK_S, 1, min(PARTS, len(left))))
            parts = np.array_split(np.sum(left**2, axis=1), count)
            rates.append(tuple(float(part.sum()) * count / self.seconds for part in parts))
        return SoFar(0.0, (rates[0], rates[1]), (T[0], T[1]), self.seconds)


def _thinned(motion: Motion, seconds: float) -> Motion:
    """Its first seconds at HZ or a little more."""
    every = max(int(motion.rate_hz // HZ), 1)
    kept = slice(0, max(int(seconds * motion.rate_hz), 1), every)
    return replace(motion.only(kept), measured=None, rate_hz=motion.rate_hz / every)
