"""Is it a law? What a function without a name says of the very signals that an effect reads, and of
everything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.leading import beside_function, with_hypothesis
from ident.diagnosis.evidence.metric import Metric, metric
from ident.diagnosis.evidence.nameless import Flexible, Signal, flexible, imitation
from ident.diagnosis.evidence.refine import Refined, refine
from ident.diagnosis.evidence.state import State
from ident.diagnosis.rows.terms import Term

LAW = 4  # free numbers; a size, a shape and a phase are fewer
NEARLY = 0.97  # of what any function says, in nats: of a strong effect this leaves hardly more than its noise
FORETOLD = 0.25  # of a residual's power: less than this is new from row to row
TOP_WAVE = 400.0  # 1/rad

InBothNoises = tuple[Flexible | None, Flexible | None]  # at hand, white


def signals_read(term: Term) -> frozenset[str] | None:
    """Names of a flexible function's signals that the effect reads itself; None: not such an effect."""
    effect, place = term.effect, term.place
    if effect.kind != "column" or place.joint is None:
        return None
    j = place.joint + 1
    table = {"q": f"q{j}", "dq": f"dq{j}", "sign_dq": f"dq{j}", "ddq": f"ddq{j}", "tau_link": "tau", "t": "t"}
    table |= {"friction": f"dq{j}", "offset": "tau"}
    if place.source is not None:
        k = place.source + 1
        table |= {"q_source": f"q{k}", "dq_source": f"dq{k}", "ddq_source": f"ddq{k}", "sign_sum": f"dq{k}"}
    read = set()
    for name in effect.needs:
        read |= {table[name]} if name in table else {f"q{j}", f"dq{j}", "memory"}
    return frozenset(read)


def sufficient(term: Term, own: Evidence, flex: Flexible | None, tau: float) -> bool:
    """A law says as much as any function of its signals on the rows that judge and on those that chose both:
    the judged ones alone speak for any law where they go further than the fitted ones, as no function does.
    (The dead zone of a UR10e's fifth torque was told as friction under load, by 107 nats where functions of
    the rate and the load say 112; on the fitted rows it was 182 against 555.)"""
    if flex is None:
        return True
    if move_alike(flex, tau):
        return False
    judged = as_much(own.log_e, flex.evidence.log_e, term.free, tau)
    return judged and short_of_fitted(term, own, flex, tau) is None


def short_of_fitted(term: Term, own: Evidence, flex: Flexible, tau: float) -> tuple[float, float] | None:
    """What a law, and functions, say of the fitted rows, where it says less than they do there."""
    return None if as_much(own.gain, flex.fitted, term.free, tau) else (float(own.gain), float(flex.fitted))


def as_much(law: float, function: float, numbers: int, tau: float) -> bool:
    """A law of up to three numbers that says as much as a function, within the limit, is a law; one with more
    numbers takes up smooth functions as they come, and has to say as much, or more. What an effect's columns
    are wrong by (filters, samples, the turn-over's shape) grows with the effect: NEARLY."""
    return bool(law > function * (NEARLY if numbers <= LAW else 1.0) + margin(numbers, tau))


def move_alike(flex: Flexible, tau: float) -> tuple[str, ...]:
    """Signals of other joints whose functions say as much, within the limit and the choice among them: where
    several joints follow one signal, the motion does not show whose position a torque follows."""
    if not flex.others:
        return ()
    least = flex.evidence.log_e - tau + float(np.log(len(flex.others)))
    return tuple(name for name, log_e in flex.others if log_e > least)


def margin(numbers: int, tau: float) -> float:
    return tau * float(np.clip(numbers - LAW, -1, 1))


def sufficiency(state: State, m: Metric, r: Refined, c: int, tau: float) -> Flexible | None:
    """The best function without a name of the signals that the effect reads. Of a law of the position, or of
    another joint's motion, that polynomials in a third one's motion imitate, its own torque, with what these
    say of it (LWR4+: five joints follow one signal, and a ripple was told of the sixth's position)."""
    read = signals_read(r.term)
    if read is None or r.term.effect.replaces:  # what the study itself left out is there, whatever else is
        return None
    place, j = r.term.place, (r.term.place.joint or 0) + 1
    positional = f"q{j}" in read and read <= {f"q{j}", f"dq{j}"}
    if (place.source is not None or positional) and c in r.columns:
        copied = _copied(state, m, r, c, tuple(sorted(read)))
        if move_alike(copied, tau):
            return copied
    return ask(state, m, c, tau, read)


def _copied(state: State, m: Metric, r: Refined, c: int, read: tuple[str, ...]) -> Flexible:
    """The effect's own torque, and what it says as a function of each signal of another joint's motion, by
    functions of its own rate where it reads that, too: whose friction it is stands."""
    torque = r.columns[c] @ r.sizes
    joint, place = state.model.channels[c].joint, r.term.place
    whose = place.joint if place.source is None else place.source
    rate = place.joint if place.source is None and f"dq{(place.joint or 0) + 1}" in read else None
    others = {
        f"{kind}{k + 1}": imitation(m, c, joint, state.segments, _signal(kind, k), torque, rate)
        for k in range(state.segments[0].q.shape[1])
        for kind in ("q", "dq", "ddq")
        if k != whose
    }
    told, *says = (weigh(m, {c: z[:, None]}, np.ones(1)) for z in (torque, *others.values()))
    return Flexible(read, torque, r.gain, told, tuple(zip(others, (e.log_e for e in says))))


def _signal(kind: str, k: int) -> Signal:
    return lambda segment: np.asarray(getattr(segment, kind)[:, k])


def ask(
    state: State, m: Metric, c: int, wanted: float, only: frozenset[str] | None = None
) -> Flexible | None:
    return ask_each(state, [m], c, wanted, only)[0]


def ask_each(
    state: State,
    metrics: Sequence[Metric],
    c: int,
    wanted: float,
    only: frozenset[str] | None = None,
    made: dict[int, np.ndarray] | None = None,
) -> list[Flexible | None]:
    """The best function without a name of a channel, in each noise."""
    joint = state.model.channels[c].joint
    load = [state.model.total(motion)[:, c] for motion in state.motions]
    return flexible(metrics, c, joint, state.segments, load, TOP_WAVE, wanted, only, made)


def in_both_noises(
    state: State,
    c: int,
    wanted: float,
    only: frozenset[str] | None = None,
    made: dict[int, np.ndarray] | None = None,
) -> InBothNoises:
    """The best function without a name of a channel in the noise at hand, and as if noise were white."""
    at_hand, plain = ask_each(state, [state.metric, state.plain_metric], c, wanted, only, made)
    return at_hand, plain


def heard(
    state: State,
    c: int,
    tau: float,
    asked: Mapping[int, InBothNoises] = MappingProxyType({}),
    only: frozenset[str] | None = None,
    made: dict[int, np.ndarray] | None = None,
) -> tuple[Flexible | None, Metric]:
    """The best function of everything (of channels `asked`, it is known), or of some signals `only`, and the
    noise that it was heard in: the one at hand, or what is left beside the best function of plain rows, which
    foretells itself from its own past and would count as noise. made: as of `ask_each`."""
    made = {} if made is None else made
    at_hand, plain = asked[c] if c in asked else in_both_noises(state, c, tau, only, made)
    found = at_hand, state.metric
    if plain is None or plain.evidence.log_e <= 0:  # nor do the judged rows know of it
        return found
    again, m = _beside(state, c, plain, tau, only, made)
    here = -np.inf if at_hand is None else at_hand.evidence.log_e
    if again is None or (here > tau and here > again.evidence.log_e):
        return found
    if again.evidence.log_e < tau and "t" in again.variables:  # a course of time is what slow noise is, too
        return found
    return again, m


def heard_where_fitted(
    state: State, c: int, tau: float, plain: Flexible, made: dict[int, np.ndarray]
) -> tuple[Flexible, Metric] | None:
    """The best function of everything in what is left beside the best one of plain rows, whatever the rows
    that judge say of it: they may not have been where it is; made: as of `ask_each`. None where it is a
    course of time, as slow noise is. (A stop that an LWR4+ met in the fitted run was 3 % of its torque, and
    45 nats in a noise that had swallowed it; the run that judges hardly touched it, and nothing was said.)"""
    again, m = _beside(state, c, plain, tau, None, made)
    return None if again is None or "t" in again.variables else (again, m)


def _beside(
    state: State,
    c: int,
    plain: Flexible,
    tau: float,
    only: frozenset[str] | None,
    made: dict[int, np.ndarray],
) -> tuple[Flexible | None, Metric]:
    """The best function in the noise that one of plain rows leaves, and that noise."""
    m = beside_function(state, c, plain.column, plain.variables)
    (again,) = ask_each(state, [m], c, tau, only, made)
    return again, m


@dataclass(frozen=True)
class Short:
    """Of an effect that says less than functions of its signals: what each says, in one noise."""

    own: Evidence
    flex: Flexible
    metric: Metric


def short_of(state: State, m: Metric, r: Refined, own: Evidence, c: int, tau: float) -> Short | None:
    """Where an effect is no law: in the noise at hand, in which it says `own`; or where that is foretold from
    its own past for the most part, and in the noise that functions of its signals leave it leaves more to say
    than it says. None: it is one. (A viscous friction of a UR10e that was a wave of the position was told as
    a dry one, by 22 nats in a noise that had swallowed both, where functions said 26; in theirs it is 111
    against 431. Dry friction then turned over within 0.4 rad/s.)
    What is wrong with a measurement is held against functions of everything: the torque itself is none of
    its signals alone. (Of a cable between an LWR4+'s joints 2 and 4, of tau_m2 and the judged run, 0.45 of
    the torque were told; of the fitted one that said 20 nats where functions of both positions say 70.)"""
    if r.term.effect.kind == "load" and not r.term.effect.windowed:
        return _short_of_positions(state, m, r, c, tau)
    flex = sufficiency(state, m, r, c, tau)
    if flex is not None and not sufficient(r.term, own, flex, tau):
        return Short(own, flex, m)
    read, measures = signals_read(r.term), r.term.effect.kind == "measurement"
    if (read is None and not measures) or r.term.effect.replaces:
        return None
    flex, their = heard(state, c, tau, only=read)
    if flex is None or (their is state.metric and not measures):
        return None
    told = weigh(their, refine(their, state.scene, r.term, turns=2).columns)
    pairs = ((told.log_e, flex.evidence.log_e), (told.gain, flex.fitted))
    return Short(told, flex, their) if any(law < function - law for law, function in pairs) else None


def _short_of_positions(state: State, m: Metric, r: Refined, c: int, tau: float) -> Short | None:
    """A steady load acts on several torques, and is asked by the one that shows it most, at its best there:
    it has to say as much as functions of its two joints' positions, or of all, or to leave them nothing to
    say: what the model's own parameters have made up for in other torques is no part of one. (A cable that
    pulled on a TX40's first joint was told as a base that is turned by a milliradian, by 40 nats. A base 2.6
    milliradians off said 11 nats of its second torque, and 61 in all, where functions say 30 of that and none
    beside it: a counterbalance was told.)"""
    joints = (r.term.place.joint, r.term.place.source)
    every = range(state.segments[0].q.shape[1]) if None in joints else joints
    positions = frozenset(f"q{k + 1}" for k in every if k is not None)
    flex = ask(state, m, c, tau, positions)
    own = weigh(m, {c: r.columns[c]})
    if flex is None or as_much(own.log_e, flex.evidence.log_e, r.term.free, tau):
        return None
    beside = with_hypothesis(state, r)
    rest = ask(beside, metric(beside.rows, *beside.design, m.whiteners), c, tau, positions)
    return Short(own, flex, m) if rest is not None and rest.evidence.log_e > tau else None


def explained_share(state: State, c: int, column: np.ndarray, rows: np.ndarray | None = None) -> float:
    """Share of what the model leaves of the channel's torque (N m, the judged rows or those given (M,), the
    model's parameters free) that a column (M,) explains as it was learned."""
    design, _ = state.design
    on = (state.rows.judged if rows is None else rows) & state.rows.use[c]
    X = design[c][1][on]
    both = np.column_stack([state.rows.Y[c, on], column[on]])
    rho, z = (both - X @ np.linalg.lstsq(X, both, rcond=1e-9)[0]).T
    return float(np.clip(1 - np.sum((rho - z) ** 2) / max(float(rho @ rho), 1e-300), 0.0, 1.0))
