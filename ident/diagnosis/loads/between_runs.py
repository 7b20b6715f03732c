"""A load on one whole run, told by what all runs have in common.

Where a load acts in all rows of a fitted run, the model answers it: its parameters come out between those
with it and those without, and what is left is small in every run. Short runs judged by halves of their own
hold little contrast then, though no other run is foretold. (A weight on a Barrett's second link took the
error of the runs that judge from 4 to 48 %; by blocks of a quarter second it was three deviations of noise.)
But with the load taken off, its run has the parameters of the others:

    log E = r / 2 ln(d without / d with),

d the square of the distance of the r parameters from the fitted to the judged runs, of which no row chose the
load: its likelihood ratio where parameters differ from run to run at random, all directions alike, and as
much as they do with the hypothesis in the model, or without it (parameters_apart.py). What else may be a
run's own is asked in the same way."""

from __future__ import annotations

from collections.abc import Callable

from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.metric import Columns, acting, side_by_side
from ident.diagnosis.evidence.state import State
from ident.diagnosis.evidence.sufficiency import NEARLY
from ident.diagnosis.loads.is_a_load import can_be
from ident.diagnosis.loads.own_of_a_run import (
    numbers,
    one_number,
    own_columns,
    own_friction,
    says_as_much,
)
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.parameters_apart import closer


def comparable(state: State, term: Term, columns: Columns) -> bool:
    """Whether it is a load on a whole fitted run, beside others that are fitted, and the runs that judge have
    chosen nothing."""
    rows, inside = state.rows, acting(columns)
    others = rows.fitted & ~inside & rows.use.any(axis=0)
    return bool(
        not term.place.comes_and_goes
        and rows.held_apart
        and not (inside & rows.judged).any()
        and others.any()
    )


def says_between(state: State) -> Callable[[Columns], float]:
    """Nats of columns that act in fitted rows. Rows count as if their noise were white: what parameters
    change by is as slow as the motion."""
    m = state.plain_metric
    return lambda columns: closer(m, columns, weigh(m, columns))


def one_number_between(
    state: State,
    term: Term,
    columns: Columns,
    tau: float,
    own: Callable[[Columns], float] = lambda columns: 0.0,
) -> bool:
    """Whether another zero or factor of one joint in its run says as much as the load does, what its own rows
    say (`own`, nats) with it. (0.2 kg on one of two fitted runs, and 0.1 kg on a part of the other: between
    the runs a zero was 8 nats behind the load, by the run's own rows far more, and none was told.)"""
    between, inside = says_between(state), acting(columns)

    def says(z: Columns) -> float:
        return own(z) + between(z)

    return says_as_much(*one_number(state, term, inside), says, says(columns), tau)


def between_runs(state: State, term: Term, columns: Columns, limit: float, tau: float) -> float | None:
    """log E [nats] of a comparable load, more than the limit; None where the judged runs do not say that it
    is one. state: without the load."""
    if not weigh(state.metric, columns).gain > tau:
        return None
    says, inside, m = says_between(state), acting(columns), state.plain_metric
    nats = says(columns)
    if not nats > limit or not can_be(state, m, term, columns, weigh(m, columns).sizes, tau):
        return None
    if one_number_between(state, term, columns, tau):
        return None
    drives, friction = own_friction(state, inside, says)
    if friction is not None:
        simpler = nats >= friction and numbers(columns) < numbers(drives)
        if not simpler and not says(side_by_side(columns, drives)) > friction + tau:
            return None
    every = says(own_columns(state, inside, range(state.rows.b)))
    return None if NEARLY * every > nats + tau else nats
