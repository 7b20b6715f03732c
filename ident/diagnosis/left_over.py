"""What functions without a name still explain in the end, and what does not stand beside them, nor beside
what the model gets wrong from one run to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.block_by_block import block_gains
from ident.diagnosis.evidence.blocks import agree
from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.metric import Metric
from ident.diagnosis.evidence.nameless import Flexible
from ident.diagnosis.evidence.nameless_beside import Functions, beside_nameless, leaned_on
from ident.diagnosis.evidence.settled import settled, without
from ident.diagnosis.evidence.state import Found, State, solved
from ident.diagnosis.evidence.sufficiency import (
    InBothNoises,
    as_much,
    ask,
    explained_share,
    heard,
    heard_where_fitted,
    in_both_noises,
    move_alike,
    signals_read,
)
from ident.diagnosis.evidence.turning_rows import apart_from_turns
from ident.diagnosis.outcome import Step, Unnamed
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.parameters_apart import Changes, beside_changes
from ident.diagnosis.search.weighing import Equivalent
from ident.diagnosis.weighed_again import asked_for

LEAST = 0.25  # share of a channel's whitened residual that is worth saying where it does not carry over
GROUPS = 60  # functions that are asked of a channel: the search that their own evidence has to pay for


def leftovers(
    state: State, steps: list[Step], unnamed: Sequence[Unnamed], tau: float, alpha: float
) -> tuple[State, list[Step], list[Unnamed]]:
    """What functions of everything still explain, channel by channel; names beside it must hold alone. What
    does not carry over is told where nothing else is, `unnamed` included, or where it kept a name away; what
    the judged rows could not show, always. One that only turning joints show may be what is not known of
    turns; a law that it takes the place of is no law for that. (Of a sensor whose scale is a cubic, on a
    joint that turns once a second, two frictions of the rate were told, by 22 and 20 nats, where a function
    of rate and torque said 41 beside them, all of rows at turns.)"""
    out: list[Unnamed] = []
    for u in unnamed:
        if u.times_noise is None:  # what is no more than a change of the model is no function beside a name
            state, steps = _laws(state, steps, u, tau)
    state, steps, doubtful, asked = overrated(state, steps, tau)
    for c in range(state.rows.channels):
        doubt = doubtful.get(c)
        changes = doubt is not None and doubt.times_noise is not None  # larger than any function there
        if changes or not (state.rows.use[c] & state.rows.judged).any():
            continue
        made: dict[int, np.ndarray] = {}
        if c not in asked:
            asked[c] = in_both_noises(state, c, tau, made=made)
        flex, m = heard(state, c, tau, asked, made=made)
        if flex is None:
            continue
        near = None if doubt is None else doubt.nearest
        if flex.evidence.log_e > tau and flex.evidence.supported(alpha):
            share = explained_share(state, c, flex.column)
            rest = Unnamed(c, flex.variables, flex.evidence.log_e, flex.evidence.gain, share, near)
            others, laws = _laws(state, steps, rest, tau)
            gone = len(others.found) < len(state.found)
            if gone or apart_from_turns(state, m, {c: flex.column[:, None]}, tau):
                state, steps, asked = others, laws, {} if gone else asked  # those were asked beside it
                out.append(rest)
                continue
        told = _where_fitted(state, c, flex, m, near, tau, alpha)
        _, plain = asked[c]
        if told is None and plain is not None and _is_there(plain, state, tau):
            again = heard_where_fitted(state, c, tau, plain, made)
            told = again and _where_fitted(state, c, *again, near, tau, alpha)
        out += [] if told is None else [told]
    there = {u.channel for u in out}
    out += [u for c, u in doubtful.items() if c not in there]
    if steps or unnamed or any(u.carries_over and u.times_noise is None for u in out):
        out = [u for u in out if u.carries_over or u.nearest is not None or u.unseen]
    return state, steps, out


def overrated(
    state: State, steps: list[Step], tau: float
) -> tuple[State, list[Step], dict[int, Unnamed], dict[int, InBothNoises]]:
    """Leave out, one after the other, what does not stand beside functions without a name, or beside what
    the model's own parameters change by; with it {channel: what was left out there} and, where anything was
    found, {channel: the best functions in the end}.

    What may be such a change keeps its place without its name: the others are asked beside it still. (A
    UR10e's first torque 3.7 times too large: its quadratic friction, 7 nats beside changes, made room for
    a function of rate and load in which 400 nats of the gain were gone.)"""
    doubtful: dict[int, Unnamed] = {}
    asked: dict[int, InBothNoises] = {}
    while named := [(k, f) for k, f in enumerate(state.found) if f.term is not None and _always(f.term)]:
        spoken = np.flatnonzero((state.rows.use & state.rows.judged).any(axis=1))
        asked = {int(c): in_both_noises(state, int(c), tau) for c in spoken}
        functions = {
            c: flex
            for c, (flex, _) in asked.items()
            if flex and flex.evidence.log_e < tau and _is_there(flex, state, tau)
        }
        others = {k: state.but(k) for k, _ in named}
        says = [(beside_nameless(others[k], f, functions, tau), k) for k, f in named]
        log_e, weakest = min(says)
        if log_e > tau:
            changes = {k: beside_changes(others[k], f, tau) for k, f in named}
            shown = {k: its for k, its in changes.items() if its is not None}
            weakest = min(shown, key=lambda k: shown[k].log_e, default=-1)
            if weakest < 0 or shown[weakest].log_e > tau:
                break
            what = _like_a_change(others[weakest], state.found[weakest], shown[weakest])
            nameless = replace(state.found[weakest], term=None, variables=what.variables)
            rest = state.swapped(weakest, nameless)
        else:
            what = _leaning(others[weakest], state.found[weakest], functions, state.metric)
            rest = others[weakest]
        doubtful[what.channel] = what
        steps = [s for s in steps if what.nearest is None or s.term.key != what.nearest.term.key]
        state, asked = settled(rest, 1), {}
    return state, steps, doubtful, asked


def _is_there(flex: Flexible, state: State, tau: float) -> bool:
    """Whether the fitted rows ask for a function. (Of a clean arm one of another joint's rate was 12 nats in
    plain rows, as the best of all is by chance, and 102 in the noise that was left beside itself.)"""
    return flex.prior_evidence > chosen_by_chance(state, tau)


def _where_fitted(
    state: State, c: int, flex: Flexible, m: Metric, near: Equivalent | None, tau: float, alpha: float
) -> Unnamed | None:
    """What the fitted rows alone show, if it is much of what is left there and their blocks foretell each
    other by it, or if it kept a name away; None: nothing that is told. With its share of their torque and
    whether the judged ones, in the noise that they have, could not show it. (Of a stop that a rokae's second
    joint touched in the fitted run alone nothing was told beside a force in the other: 9 % of that torque.)
    No other rows are at the same time."""
    alone = _fitted_alone(c, flex, m, near)
    there = alone.share > LEAST and _is_there(flex, state, tau)
    if near is None and not (there and _is_foretold(flex, state, m, c, tau, alpha)):
        return None
    could = "t" in flex.variables or not flex.evidence.expected.sum() < tau
    share = explained_share(state, alone.channel, flex.column, state.rows.fitted)
    return replace(alone, unseen=not could, share=share)


def chosen_by_chance(state: State, tau: float) -> float:
    """What the best of all functions that were asked has to say of the rows that chose it [nats]: of so many
    one says something of any noise."""
    return tau + float(np.log(GROUPS * state.rows.channels))


def _is_foretold(flex: Flexible, state: State, m: Metric, c: int, tau: float, alpha: float) -> bool:
    """Whether the blocks of the fitted rows are foretold by a function as all the others have it, and none
    contradicts it: that it says much of the rows that chose it is told of a spike, too. (Were the function
    there, a block would be foretold worse by x nats in a share exp(-x) of all cases at most.)"""
    gains = block_gains(state, m, c, flex)
    contradicted = gains.min(initial=0.0) < -np.log(max(len(gains), 1) / alpha)
    much = gains.sum() > chosen_by_chance(state, tau)
    return much and not contradicted and agree(gains, np.full(len(gains), np.inf), alpha)


def _laws(state: State, steps: list[Step], rest: Unnamed, tau: float) -> tuple[State, list[Step]]:
    """Without what is no law of a channel in which a function without a name finds the rest beside it: what
    such a function alone, learned in its place, says more than, and leaves nothing to say. (What the study
    itself left out is there whatever is beside it: of a UR10e without viscous friction that of joints 2 and 4
    was taken back, and the error ended at 8.1 instead of 4.6 %.)"""
    c = rest.channel
    for number, f in reversed(list(enumerate(state.found))):
        if f.term is None or f.term.place.joint is None or c not in f.columns or f.term.effect.replaces:
            continue
        others = state.but(number)
        named = tuple(g for g in others.found if g.term is not None or c not in g.columns)
        if len(named) < len(others.found):
            others = solved(replace(others, found=named))
        learned = ask(others, others.metric, c, tau)
        own = weigh(others.metric, f.columns)
        if learned is None or _is_a_law(f.term, own, rest, learned, tau):
            continue  # what is left is told beside it
        column = Found(None, {c: learned.column[:, None]}, np.ones(1), learned.variables)
        if _less_than(rest, f.term, own) or asked_for(solved(others.plus(column)), f, tau) < tau:
            steps = [s for s in steps if s.term.key != f.term.key]
            state = without(state, number)
    return state, steps


def _is_a_law(term: Term, own: Evidence, rest: Unnamed, learned: Flexible, tau: float) -> bool:
    """Whether an effect says as much as functions alone do, on the judged rows and on those that chose it;
    with the rest, where that is of other signals than it reads itself. Judged rows alone speak for any law
    where they go further than the fitted ones, as no function does. (The dead zone of a third torque was told
    as a gain of 0.88, by 859 nats on such rows, where functions of the torque say 171; on the fitted ones it
    was 289 against 2,228.)

    Beside a rest of none of its signals it need not say all of what functions do: these learn the rest, too,
    and of a joint's position its gravity. (An AIRBOT's torque 2, five times too large: 133 nats and 15 of
    ddq1 beside, 147 of q2 and q3 alone; a spring of an arm whose friction is none of the catalogue: 1,466 and
    128 of dq3 and ddq3, 1,539 of q3 and dq3 alone.)"""
    read, others = _own_signals(term), set(rest.variables)
    apart = not others <= read
    if _less_than(rest, term, own):
        return False
    alone = not move_alike(learned, tau) and as_much(own.log_e, learned.evidence.log_e, term.free, tau)
    beside = not others & read and own.log_e + rest.log_e >= learned.evidence.log_e
    fitted = as_much(own.gain + apart * rest.gain, learned.fitted, term.free, tau)
    return bool((alone or beside) and fitted)


def _own_signals(term: Term) -> frozenset[str]:
    """What an effect reads; one on a whole torque, that."""
    read = signals_read(term)
    return frozenset({"tau"}) if read is None else read


def _less_than(rest: Unnamed, term: Term, own: Evidence) -> bool:
    """Whether functions of an effect's own signals say more beside it than it says itself, on the judged rows
    and on those that chose both. (The dead zone of a rokae's third torque was told as a gain of 0.87, by 27
    and 15 nats in a noise that had swallowed both; beside it functions of the torque say 36 and 78.)"""
    return set(rest.variables) <= _own_signals(term) and rest.log_e > own.log_e and rest.gain > own.gain


def _leaning(others: State, f: Found, functions: Functions, m: Metric) -> Unnamed:
    """What was found leans on rows where functions without a name say as much: told is the one that says
    most there, in the metric `m` of the model with both; others: the state without it."""
    assert f.term is not None
    e = weigh(others.metric, f.columns)
    near = leaned_on(f, e, functions)
    c = max(near, key=lambda c: (c in f.columns, functions[c].prior_evidence))
    return _fitted_alone(c, functions[c], m, Equivalent(f.term, e.log_e))


def _like_a_change(others: State, f: Found, beside: Changes) -> Unnamed:
    """What was found is no more than what the model gets wrong from one run to the next."""
    assert f.term is not None
    e, c = weigh(others.metric, f.columns), beside.channel
    read = tuple(sorted(signals_read(f.term) or ()))
    share = explained_share(others, c, f.columns[c] @ f.sizes)
    near = Equivalent(f.term, beside.told)  # where it shows: the judged rows alone need not
    kappa, kind = beside.kappa, beside.of_its_kind
    return Unnamed(c, read, e.log_e, e.gain, share, near, times_noise=kappa, of_its_kind=kind)


def _fitted_alone(c: int, flex: Flexible, m: Metric, near: Equivalent | None) -> Unnamed:
    """What does not carry over: its share is that of the rows that it was learned on, whitened."""
    told = flex.evidence
    wide = float(1 - np.exp(-2 * told.gain / m.fitted.free[c]))
    return Unnamed(c, flex.variables, told.log_e, told.gain, wide, near, carries_over=False)


def _always(term: Term) -> bool:
    """Not a load of one run, nor what the study itself left out, which is there whatever else is."""
    return term.place.recording is None and not term.effect.replaces
