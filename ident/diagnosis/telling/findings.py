"""What is told: findings with the numbers of the last fit and the evidence of the loop, and what no known
effect explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ident.diagnosis.evidence.evidence import drop_percent
from ident.diagnosis.evidence.state import State, solved
from ident.diagnosis.evidence.sufficiency import explained_share, signals_read
from ident.diagnosis.extended.approximated import Moved, apart, deviations
from ident.diagnosis.extended.by_rows_that_judge import own_deviations
from ident.diagnosis.extended.in_a_study import is_told, same
from ident.diagnosis.extended.last_fit import Refusal
from ident.diagnosis.outcome import BUDGET, Outcome, Step, Unnamed
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.settling import place_of, without_terms
from ident.diagnosis.search.weighing import Equivalent, main_channel
from ident.diagnosis.telling.pictures import Picture, picture
from ident.diagnosis.telling.seconds_apart import seconds_apart
from ident.estimation.fit import FitResult
from ident.estimation.found_effects import FoundEffect, found_effects

ESTABLISHED, PARTLY = "established", "partly"


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another explanation of a finding that these data cannot reject; None: named by a check of the
    recordings, its evidence was not weighed."""

    effect: str
    joints: tuple[int, ...]
    log_e: float | None
    error_drop_percent: float | None
    source_joint: int | None = None  # of a pair of joints, the other one
    link: int | None = None
    seconds: float | None = None  # of motion as recorded until the two are told apart
    recording: str | None = None  # the only one in which it acts
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # as the fitted rows have it
    side: str | None = None  # of its place; None: every torque of its joints

    @property
    def named(self) -> dict[str, Any]:
        """Effect, place and parameters as the document has them."""
        where = {"source_joint": self.source_joint, "link": self.link, "recording": self.recording}
        where["side"] = self.side
        beside = {**where, "parameters": self.parameters or None}
        known = {name: value for name, value in beside.items() if value is not None}
        return {"effect": self.effect, "joints": list(self.joints), **known}


@dataclass(frozen=True, slots=True)
class Finding:
    """One effect that the model lacked; parameters {name: {value, std, unit, at_bound}} of the last fit."""

    effect: str
    joints: tuple[int, ...]
    channel: str
    where: Mapping[str, Any]  # side, recording, from, to, source_joint, link
    parameters: Mapping[str, Mapping[str, Any]]
    p_value: float
    log_e: float
    gain: float
    error_drop_percent: float  # of its channel, whitened, on rows that chose nothing
    equivalent: tuple[Alternative, ...]
    remedy: str
    grade: str
    signature: str
    picture: Picture | None = None
    seconds_offered: float | None = None  # of the motion made to tell it from all of `equivalent`
    so_far: tuple[Mapping[str, Any], ...] = ()  # what the rows that judge say of every two of them


@dataclass(frozen=True, slots=True)
class Unexplained:
    """Structure that no known effect explains; share of what the model leaves of the channel's torque."""

    joints: tuple[int, ...]
    channel: str
    depends_on: tuple[str, ...]
    share_of_residual_percent: float
    log_e: float
    nearest: Alternative | None
    carries_over: bool
    picture: Picture | None = None
    alike: tuple[str, ...] = ()  # signals of other joints that it may as well depend on
    times_noise: float | None = None  # of the change that keeps `nearest` away, the parameters', or
    of_its_kind: bool = False  # that of others of its kind
    by_chance: float | None = None  # p of the sizes of `nearest`, by the stretches, which keeps it away
    errors: tuple[float, float] | None = None  # % without `nearest` and with it, which keep it away
    on_fitted: tuple[float, float] | None = None  # nats of `nearest`, and of functions, if these keep it away
    unseen: bool = False  # the judged rows do not go where it acts: they could not show it
    stretch: tuple[str, float, float, float] | None = None  # there alone: recording, from, to, first stamp
    oscillates_hz: float | None = None  # of its own: its past foretells it, not a function of time


@dataclass(frozen=True, slots=True)
class Hint:
    """An effect that the judged rows ask for as much as for one that is told, in too few of their blocks."""

    what: Alternative
    channel: str
    blocks_for: int
    blocks: int
    equivalent: tuple[Alternative, ...]


def _joints(term: Term, state: State) -> tuple[int, ...]:
    labels = state.problem.robot.joint_labels
    return () if term.place.joint is None else (int(labels[term.place.joint]),)


def _channel(c: int, state: State) -> str:
    return state.model.channels[c].name(state.problem.robot.joint_labels)


def _side(c: int, state: State) -> str:
    return _channel(c, state).rstrip("0123456789")


def findings_of(outcome: Outcome, last: FitResult, moved: Moved) -> tuple[Finding, ...]:
    """What the loop found and the last fit has; what is worth most in practice first, whole explanations and
    parts of one alike. (A ripple that took 58 % of a UR10e's second torque, which has another structure
    beside it, stood behind four others of 11 to 29 %.)"""
    state = outcome.last
    told = list(found_effects(last)) if last.terms else []
    out = []
    for step in outcome.steps:
        term = next((t for t in state.terms if t.key == step.term.key), None)
        fitted = next((f for f in told if term is not None and same(f.term, term)), None)
        if term is not None and fitted is not None:
            told.remove(fitted)  # one that grew by more of its parameters is one finding
            out.append((_practical_size(state, term), _finding(step, term, fitted, outcome, moved)))
    return tuple(f for _, f in sorted(out, key=lambda its: -its[0]))


def _practical_size(state: State, term: Term) -> float:
    """By how much the error of all channels, which the report puts first, would be larger without an effect
    (squares, of the torque's, the model free to answer), in its recording where it acts in one. (Channel by
    channel a delay of an AIRBOT stood before a weight that took its error from 14 to 7 %: half of its first
    torque, which carries next to nothing, is left with either.)"""
    number = place_of(state, term)
    if number is None:
        return 0.0
    rows, rest = state.rows, solved(state.but(number))
    mine, recording = rows.use, term.place.recording
    if recording is not None:
        mine = mine & (rows.recording == rows.names.index(recording))
    torque = np.sum(np.where(mine, rows.Y, 0.0) ** 2)
    more = np.sum(np.where(mine, rest.residual**2 - state.residual**2, 0.0))
    return float(more / max(torque, 1e-300))


def _finding(step: Step, term: Term, fitted: FoundEffect, outcome: Outcome, moved: Moved) -> Finding:
    state, e = outcome.last, step.evidence
    own_rows = own_deviations(state, term)
    two_fits = {} if own_rows else apart(state, term, fitted)
    stds = deviations(fitted, own_rows, moved.get(term.key, {}), two_fits)
    place = term.place
    c = main_channel(e, term, state)
    labels = state.problem.robot.joint_labels
    where = {
        "side": place.side,
        "source_joint": None if place.source is None else int(labels[place.source]),
        "recording": place.recording,
        "from": place.start,
        "to": place.stop,
        "link": place.link,
        "first_stamp": state.begins(place.recording) if place.comes_and_goes else None,
    }
    left = {u.channel for u in outcome.unnamed}
    own = set(place.rows(state.model.channels))
    partly = place.joint is not None and bool(left & own)
    return Finding(
        term.effect.name,
        _joints(term, state),
        _side(c, state),
        {key: value for key, value in where.items() if value is not None},
        {
            name: {
                "value": p.value,
                "std": stds.get(name),
                "unit": p.unit,
                "at_bound": p.at_bound,
            }
            for name, p in fitted.parameters.items()
        },
        float(min(1.0, np.exp(-e.log_e) * BUDGET)),
        float(e.log_e),
        float(e.gain),
        drop_percent(e.per_channel[c], e.free[c]),
        tuple(
            replace(
                _alternative(eq, state, e.free[c]),
                seconds=seconds_apart(state, term, eq.term),
                recording=None if eq.term.place.recording == place.recording else eq.term.place.recording,
            )
            for eq in step.equivalent
        ),
        term.effect.remedy_with({name: p.value for name, p in fitted.parameters.items()}),
        PARTLY if partly else ESTABLISHED,
        term.effect.signature,
        picture(state, term, c),
    )


def unexplained_of(u: Unnamed, outcome: Outcome) -> Unexplained:
    state = outcome.last
    joint = int(state.problem.robot.joint_labels[state.model.channels[u.channel].joint])
    name = _channel(u.channel, state)
    near = u.nearest
    return Unexplained(
        (joint,),
        _side(u.channel, state),
        tuple(dict.fromkeys(_signal(v, name) for v in u.variables)),
        100 * u.share,
        u.log_e,
        None
        if near is None
        else Alternative(near.term.effect.name, _joints(near.term, state), float(near.log_e), 0.0),
        u.carries_over,
        picture(state, None, u.channel, u.variables),
        u.alike,
        u.times_noise,
        on_fitted=u.on_fitted,
        unseen=u.unseen,
        of_its_kind=u.of_its_kind,
    )


def _alternative(its: Equivalent, state: State, free: float) -> Alternative:
    """free: of the rows of the channel whose error it lowers."""
    place, labels = its.term.place, state.problem.robot.joint_labels
    source = None if place.source is None else int(labels[place.source])
    drop = drop_percent(its.log_e, free)
    joints, log_e = _joints(its.term, state), float(its.log_e)
    return Alternative(its.term.effect.name, joints, log_e, drop, source, place.link, side=place.side)


def hint_of(step: Step, outcome: Outcome) -> Hint:
    state, e = outcome.last, step.evidence
    c = main_channel(e, step.term, state)
    return Hint(
        _alternative(Equivalent(step.term, e.log_e), state, e.free[c]),
        _side(c, state),
        int((e.blocks > 0).sum()),
        int(np.count_nonzero(e.blocks)),
        tuple(_alternative(eq, state, e.free[c]) for eq in step.equivalent),
    )


def as_told(outcome: Outcome, last: FitResult) -> State:
    """The loop's state with what is handed over alone."""
    return without_terms(outcome.last, (t for t in outcome.last.terms if not is_told(last, t)))


def not_told(outcome: Outcome, refused: Mapping[tuple, Refusal]) -> tuple[Unexplained, ...]:
    """What the loop found and the last fit does without."""
    steps = [step for step in outcome.steps if step.term.key in refused]
    return tuple(_not_told(step, outcome, refused[step.term.key]) for step in steps)


def _not_told(step: Step, outcome: Outcome, why: Refusal) -> Unexplained:
    state, e, term = outcome.last, step.evidence, step.term
    c = main_channel(e, term, state)
    joint = int(state.problem.robot.joint_labels[state.model.channels[c].joint])
    number, share = place_of(state, term), 0.0
    if number is not None and c in state.found[number].columns:
        f = state.found[number]
        share = 100 * explained_share(state.but(number), c, f.columns[c] @ f.sizes)
    near = Alternative(term.effect.name, _joints(term, state), float(e.log_e), 0.0)
    name = _channel(c, state)
    signals = tuple(dict.fromkeys(_signal(v, name) for v in sorted(signals_read(term) or ())))
    shown = picture(state, term, c)
    side, log_e = _side(c, state), float(e.log_e)
    return Unexplained(
        (joint,), side, signals, share, log_e, near, True, shown, by_chance=why.by_chance, errors=why.errors
    )


def _signal(variable: str, channel: str) -> str:
    return channel if variable == "tau" else variable


def explainable(outcome: Outcome) -> dict[str, dict[str, float]]:
    """Per channel: nats that names explain of what names and functions without a name do together."""
    state = outcome.last
    named, nameless = np.zeros(state.rows.channels), np.zeros(state.rows.channels)
    for step in outcome.steps:
        place = step.term.place
        own = range(len(named)) if place.joint is None else place.rows(state.model.channels)
        for c in own:
            named[c] += max(float(step.evidence.per_channel[c]), 0.0)
    for u in outcome.unnamed:
        nameless[u.channel] += max(u.log_e, 0.0)
    out = {}
    for c in range(state.rows.channels):
        whole = float(named[c] + nameless[c])
        share = 100.0 * float(named[c]) / whole if whole > 0 else 100.0
        out[_channel(c, state)] = {"explainable_nats": whole, "explained_share_percent": share}
    return out
