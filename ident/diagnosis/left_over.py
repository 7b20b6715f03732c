"""What functions without a name still explain in the end, and what does not stand beside them, nor beside
what the model gets wrong from one run to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence import Evidence, Metric, weigh
from ident.diagnosis.nameless import Flexible
from ident.diagnosis.nameless_beside import Functions, beside_nameless, leaned_on
from ident.diagnosis.outcome import Step, Unnamed
from ident.diagnosis.parameters_apart import Changes, beside_changes
from ident.diagnosis.state import Found, State, solved, without
from ident.diagnosis.sufficiency import ask, explained_share, heard, signals_read, sufficient
from ident.diagnosis.terms import Term
from ident.diagnosis.weighed_again import asked_for
from ident.diagnosis.weighing import Equivalent

LEAST = 0.25  # share of a channel's whitened residual that is worth saying where it does not carry over
GROUPS = 60  # functions that are asked of a channel: the search that their own evidence has to pay for


def leftovers(
    state: State, steps: list[Step], unnamed: Sequence[Unnamed], tau: float, alpha: float
) -> tuple[State, list[Step], list[Unnamed]]:
    """What functions of everything still explain, channel by channel; names beside it must hold alone. What
    does not carry over is told where nothing else is, `unnamed` included, or where it kept a name away."""
    out: list[Unnamed] = []
    state, steps, doubtful, asked = overrated(state, steps, tau)
    for c in range(state.rows.channels):
        doubt = doubtful.get(c)
        changes = doubt is not None and doubt.times_noise is not None  # larger than any function there
        if changes or not (state.rows.use[c] & state.rows.judged).any():
            continue
        flex, m = heard(state, c, tau, asked)
        if flex is None:
            continue
        near = None if doubt is None else doubt.nearest
        if flex.evidence.log_e < tau or not flex.evidence.supported(alpha):
            alone = _fitted_alone(c, flex, m, near)
            if near is not None or (alone.share > LEAST and _is_there(flex, state, tau)):
                out.append(alone)
            continue
        share = explained_share(state, c, flex.column)
        column = Found(None, {c: flex.column[:, None]}, np.ones(1), flex.variables)
        for number, f in reversed(list(enumerate(state.found))):
            if f.term is None or f.term.place.joint is None or c not in f.columns:
                continue
            others = state.but(number)
            learned = ask(others, others.metric, c, tau)
            own = weigh(others.metric, f.columns)
            if learned is None or sufficient(f.term, own, learned, tau) or _whole(f.term, own, flex, learned):
                continue  # a law still; what is left is told beside it
            beside = solved(others.plus(replace(column, columns={c: learned.column[:, None]})))
            if asked_for(beside, f, tau) < tau:
                steps = [s for s in steps if s.term.key != f.term.key]
                state, asked = without(state, number), {}  # those were asked beside it
        out.append(Unnamed(c, flex.variables, flex.evidence.log_e, flex.evidence.gain, share, near))
    there = {u.channel for u in out}
    out += [u for c, u in doubtful.items() if c not in there]
    if steps or unnamed or any(u.carries_over and u.times_noise is None for u in out):
        out = [u for u in out if u.carries_over or u.nearest is not None]
    return state, steps, out


def overrated(
    state: State, steps: list[Step], tau: float
) -> tuple[State, list[Step], dict[int, Unnamed], dict[int, Flexible | None]]:
    """Leave out, one after the other, what does not stand beside functions without a name, or beside what
    the model's own parameters change by; with it {channel: what was left out there} and, where anything was
    found, {channel: the best function in the end}."""
    doubtful: dict[int, Unnamed] = {}
    asked: dict[int, Flexible | None] = {}
    while named := [(k, f) for k, f in enumerate(state.found) if f.term is not None and _is_a_law(f.term)]:
        spoken = np.flatnonzero((state.rows.use & state.rows.judged).any(axis=1))
        asked = {int(c): ask(state, state.metric, int(c), tau) for c in spoken}
        functions = {
            c: flex
            for c, flex in asked.items()
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
        else:
            what = _leaning(others[weakest], state.found[weakest], functions, state.metric)
        doubtful[what.channel] = what
        steps = [s for s in steps if what.nearest is None or s.term.key != what.nearest.term.key]
        state, asked = without(state, weakest), {}
    return state, steps, doubtful, asked


def _is_there(flex: Flexible, state: State, tau: float) -> bool:
    """Whether the fitted rows ask for a function, the choice among all that were asked paid for: the best of
    so many says something of any noise."""
    return flex.prior_evidence > tau + np.log(GROUPS * state.rows.channels)


def _whole(term: Term, own: Evidence, rest: Flexible, learned: Flexible) -> bool:
    """Whether an effect on a whole torque, which is no function of its joint's signals, says with what is
    left beside it as much as functions do alone: these learn a joint's gravity from its position. (An
    AIRBOT's torque 2, five times too large: 133 nats and 15 of ddq1 beside, 147 of q2 and q3 alone.)"""
    return signals_read(term) is None and own.log_e + rest.evidence.log_e >= learned.evidence.log_e


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
    return Unnamed(c, read, e.log_e, e.gain, share, near, times_noise=beside.kappa)


def _fitted_alone(c: int, flex: Flexible, m: Metric, near: Equivalent | None) -> Unnamed:
    """What does not carry over: its share is that of the rows that it was learned on, whitened."""
    told = flex.evidence
    wide = float(1 - np.exp(-2 * told.gain / m.fitted.free[c]))
    return Unnamed(c, flex.variables, told.log_e, told.gain, wide, near, carries_over=False)


def _is_a_law(term: Term) -> bool:
    """Not a load of one run, nor what the study itself left out, which is there whatever else is."""
    return term.place.recording is None and not term.effect.replaces
