"""The loop: what explains most joins the model if rows that chose nothing agree; until nothing does.

Every decision is one comparison (evidence.py) at one rate, tau = ln(BUDGET / alpha): BUDGET hypotheses at
most are held against the judged rows. An effect that passes is named only if a function without a name, of
the very signals that the effect reads, does not say more than tau beyond it (sufficiency); two effects of
the same signals may be sufficient together. What is left in the end is asked for by functions of everything
(leftovers)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.metric import side_by_side, whole
from ident.diagnosis.evidence.refine import Refined, fit_sizes
from ident.diagnosis.evidence.settled import with_found
from ident.diagnosis.evidence.state import Found, State, solved
from ident.diagnosis.evidence.sufficiency import (
    NEARLY,
    Short,
    as_much,
    explained_share,
    margin,
    move_alike,
    short_of,
    short_of_fitted,
    signals_read,
)
from ident.diagnosis.left_over import leftovers
from ident.diagnosis.loads.events import Event, best_event, chosen, others_of
from ident.diagnosis.loads.loads_in_turn import in_turn
from ident.diagnosis.loads.still_a_load import still_holds
from ident.diagnosis.outcome import BUDGET, Outcome, Step, Unnamed, threshold
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Library, Ranked, Ranking, beside, elsewhere, ranked, short_list
from ident.diagnosis.search.exchanged import by_exchange
from ident.diagnosis.search.halves import by_halves
from ident.diagnosis.search.in_common import by_common
from ident.diagnosis.search.left_out import left_out
from ident.diagnosis.search.settling import (
    Settled,
    as_late,
    in_time,
    late_alone,
    late_as_a_whole,
    late_joints,
    on_late_rows,
    refined_together,
    settled_anew,
    settled_in,
)
from ident.diagnosis.search.two_together import two_together
from ident.diagnosis.search.weighing import (
    Equivalent,
    Weighed,
    compared,
    could_stand,
    holds,
    main_channel,
    nearly,
    rivals_of,
    simplest,
)
from ident.diagnosis.weighed_again import foretells_worse, pruned, reconsidered
from ident.progress import Progress, silent
from modelgen.effects.place import Place

STEPS = 14  # effects at most
SECOND = 3  # effects that are asked beside one that is short of a law
LATE = 2  # joints of which it is asked whether their torque comes late where nothing else is told


@dataclass(frozen=True)
class Taken:
    """What a round ends with: the state with more in it, and what is told of that."""

    state: State
    told: Step | Unnamed


def trace(
    first: State, library: Library, alpha: float = 0.01, progress: Progress = silent, max_steps: int = STEPS
) -> Outcome:
    """Look for what the model lacks. Pure: rows in, an outcome out."""
    tau = threshold(alpha)
    state, steps = first, list[Step]()
    unnamed: list[Unnamed] = []
    closed: set[int] = set()
    loads, on_time = True, False
    rounds: list[Weighed] = []
    instead: dict[tuple, float] = {}
    progress("what the study left out", 0.15)
    forgotten = left_out(state, library, tau)
    if forgotten is not None:
        state, missing = forgotten
        steps += [Step(term, e, ()) for term, e in missing]
    while len(steps) < max_steps:
        done, step = 0.15 + 0.75 * (1 - 0.75 ** len(steps)), f"step {len(steps) + 1}"
        progress(f"{step}: what could be missing", done)
        ranking = ranked(state, library, frozenset(closed))
        listed = short_list(ranking)
        progress(f"{step}: weighing it", done)
        weighed = _but(compared(state, listed, tau, alpha), instead)
        rounds, taken = [weighed], None
        if not weighed.passed and not on_time:
            progress(f"{step}: whether all torques are late", done)
            late = late_as_a_whole(state, library.places, tau, alpha)
            on_time, taken = late is None, late and _settled(late, late.tried)
        if taken is None and (loads or not weighed.passed):  # without any at first asked again at the end
            progress(f"{step}: loads and contacts", done)
            event = best_event(state, library, tau, alpha)
            loads = event is not None
            taken = _load(state, event, weighed, tau, alpha)
        told = {u.nearest.term.key for u in unnamed if u.nearest is not None}
        while taken is None and not weighed.passed:
            taken = _unclear(state, weighed, ranking, tau, alpha)
            end = None if taken else _at_an_end(state, weighed, told, tau, alpha)
            if end is not None:
                progress(f"{step}: asking what else its joint may lack", done)
                weighed = _in_its_place(state, end[0].term, ranking, listed, tau, alpha)
                taken = None if weighed.passed else _ended(state, *end)
                break
            further = [] if taken else elsewhere(ranking, listed, tau, BUDGET - len(listed))
            if not further:
                break
            listed += further
            progress(f"{step}: asking the other joints", done)
            weighed = _but(compared(state, further, tau, alpha), instead)
            rounds.append(weighed)
        if taken is None and not weighed.passed:
            progress(f"{step}: whether a joint's torque is late", done)
            where = late_joints(state, ranking, rounds, tau)[:LATE]
            its = late_alone(state, library.places, where, tau, alpha)
            its = its or next((two for w in rounds if (two := two_together(state, w, tau, alpha))), None)
            if its is None:
                break
            taken = _settled(its, its.tried)
        taken = taken or _foretelling(state, weighed, library, tau, alpha)
        if taken is None:
            break
        state = taken.state
        if isinstance(taken.told, Step):
            steps.append(taken.told)
            instead |= _instead(rounds, taken.told)
        else:
            unnamed.append(taken.told)
            closed.add(state.model.channels[taken.told.channel].joint)
    progress("what is left", 0.92)
    state, steps = reconsidered(state, steps, library, tau, alpha)
    state, steps = in_turn(state, steps, tau, alpha)
    state, steps = pruned(state, steps, tau, alpha)
    state = on_late_rows(state)
    state, steps, left = leftovers(state, steps, unnamed, tau, alpha)
    there = {term.key for term in state.terms}  # what is found itself is no other explanation of the rest
    steps = [replace(s, equivalent=tuple(e for e in s.equivalent if e.term.key not in there)) for s in steps]
    steps = [replace(s, passed=(*s.passed, *as_late(s.term, library.places, s.passed))) for s in steps]
    silent_end = not (steps or unnamed or left or state.found)
    near = [its for weighed in rounds for its in nearly(weighed, tau, alpha)] if silent_end else []
    hints = tuple(Step(r.term, e, beside) for r, e, beside in near)
    return Outcome(first, state, tuple(steps), (*unnamed, *left), tau, hints=hints)


def _instead(rounds: Sequence[Weighed], step: Step) -> dict[tuple, float]:
    """{key of what says nearly all that a step says, in its place: what that has to say beside it}: more than
    columns are wrong by. Of one torque they would else make two that share it, and neither is asked for. (Of
    an arm with Dahl's friction that MuJoCo moved a Maxwell slip said 13 nats beside 1,386 of that.)"""
    own, joint = step.evidence.log_e, step.term.place.joint
    every = ((r.term, e) for weighed in rounds for r, e in weighed.all)
    alone = (term for term, e in every if e.log_e > NEARLY * own and term.place.joint == joint)
    return {term.key: (1 - NEARLY) * own for term in alone}


def _but(weighed: Weighed, instead: Mapping[tuple, float]) -> Weighed:
    """Without what says no more than it has to."""

    def kept(its: Sequence[tuple[Refined, Evidence]]) -> tuple[tuple[Refined, Evidence], ...]:
        return tuple((r, e) for r, e in its if e.log_e > instead.get(r.term.key, -np.inf))

    return replace(
        weighed, all=kept(weighed.all), passed=kept(weighed.passed), possible=kept(weighed.possible)
    )


def _settled(its: Settled, beside: tuple[Term, ...]) -> Taken:
    return Taken(its.state, Step(its.refined.term, its.evidence, its.rivals, beside))


def _load(state: State, event: Event | None, weighed: Weighed, tau: float, alpha: float) -> Taken | None:
    """A load that says more than every other explanation is taken before them."""
    most = max((e.gain + e.log_e for _, e in weighed.passed), default=-np.inf)
    if event is None or event.evidence.log_e <= most or _outdone(event, state, weighed, tau, alpha):
        return None
    r = event.refined
    told = Step(r.term, event.evidence, others_of(event))
    return Taken(with_found(state, Found(r.term, r.columns, r.sizes)), told)


def _foretelling(state: State, weighed: Weighed, library: Library, tau: float, alpha: float) -> Taken | None:
    """The best that passed (`_best`) of those that foretell the judged rows no worse once they are settled;
    None where none does. (Beside 20 ms of all torques of a Franka a gear's play passed by 72 nats; settled,
    the two ended at two milliseconds, and the judged rows spoke by 900 nats against both.)"""
    while weighed.passed:
        taken = _best(state, weighed, library, tau, alpha)
        if not foretells_worse(taken.state, state, tau):
            return taken
        best, _ = simplest(weighed, tau)
        weighed = replace(weighed, passed=tuple(its for its in weighed.passed if its[0] is not best))
    return None


def _best(state: State, weighed: Weighed, library: Library, tau: float, alpha: float) -> Taken:
    """The simplest of the best that passed: as it is, late or settled in, or, where more is to be said of its
    signals than it says, what is left without a name."""
    best, evidence = simplest(weighed, tau)
    c = main_channel(evidence, best.term, state)
    late_at = _late_instead(weighed, best, evidence)
    if late_at is not None:
        late = in_time(state, library.places, late_at, tau, alpha)
        if late is not None and not late.evidence.given and late.evidence.log_e > evidence.log_e:
            return _settled(late, (*late.tried, *could_stand(weighed, best, tau)))

    def step() -> Step:
        rivals = rivals_of(weighed, best, evidence, tau, alpha)
        return Step(best.term, evidence, rivals, could_stand(weighed, best, tau))

    short = short_of(state, weighed.metric, best, evidence, c, tau)
    if short is not None:
        afresh = settled_in(state, weighed, best, c, tau, alpha)
        if afresh is not None:
            return _settled(afresh, could_stand(weighed, best, tau))
        flex, alike = short.flex, move_alike(short.flex, tau)
        begun = None if alike else _beside_a_second(state, weighed, best, short, library, tau, alpha)
        if begun is None:
            what = Unnamed(
                c,
                flex.variables,
                flex.evidence.log_e,
                flex.evidence.gain,
                explained_share(state, c, flex.column),
                Equivalent(best.term, short.own.log_e),
                alike=alike,
                on_fitted=short_of_fitted(best.term, short.own, flex, tau),
            )
            function = Found(None, {c: flex.column[:, None]}, np.ones(1), flex.variables)
            return Taken(with_found(state, function), what)
        return Taken(begun, step())
    return Taken(refined_together(with_found(state, Found(best.term, best.columns, best.sizes))), step())


def _late_instead(weighed: Weighed, best: Refined, evidence: Evidence) -> Place | None:
    """Where a torque is told to come late, or where that says more than the best one on its channels and only
    blocks do not agree: beside a turn-over that was settled without it they seldom do. (At three times the
    noise 25 ms of a third joint were a coupling to the second.)"""
    if best.term.effect.shifts_time:
        return best.term.place
    late = [
        (r, e) for r, e in weighed.all if r.term.effect.shifts_time and set(r.columns) & set(best.columns)
    ]
    more = [(e.log_e, r.term.place) for r, e in late if e.log_e > evidence.log_e]
    return max(more, key=lambda its: its[0])[1] if more else None


def _outdone(event: Event, state: State, weighed: Weighed, tau: float, alpha: float) -> bool:
    """Whether a law that may be, though too few blocks speak for it to be told, leaves the load nothing to
    say, and says as much of all rows as it, each number that was chosen for either paid: a base's tilt of
    3 mrad was told as a force on all but a second of a run, one of half a milliradian as another."""
    r, every = event.refined, whole(state.metric, state.rows.usable)
    load = Found(r.term, r.columns, r.sizes)
    price = 0.5 * float(np.log(every.fitted.mask.sum()))
    least = event.gain - price * chosen(r.term)
    likely = [
        (o, e)
        for o, e in weighed.possible
        if e.log_e > tau and fit_sizes(every, o.columns)[1] - price * o.term.free > least
    ]
    return any(
        not still_holds(solved(state.plus(Found(o.term, o.columns, o.sizes))), load, tau, alpha)
        for o, _ in likely
        if set(o.columns) & set(r.columns)
    )


def _unclear(state: State, weighed: Weighed, ranking: Ranking, tau: float, alpha: float) -> Taken | None:
    """Where nothing passed as it is: what holds in other rows, or once it was settled in; None: nothing."""
    ways = (by_halves, by_common, by_exchange)
    hidden = next((its for way in ways if (its := way(state, weighed, tau, alpha))), None)
    if hidden is not None:
        r, e, others = hidden
        step = Step(r.term, e, tuple(Equivalent(o.term, n.log_e) for o, n in others))
        return Taken(refined_together(with_found(state, Found(r.term, r.columns, r.sizes))), step)
    held = _doubtful(state, weighed, ranking, tau, alpha)
    return None if held is None else _settled(held, could_stand(weighed, held.refined, tau))


def _doubtful(state: State, weighed: Weighed, ranking: Ranking, tau: float, alpha: float) -> Settled | None:
    """Where nothing holds but something says much, or upsets the judged rows: whether it holds once it was
    settled in, and what would explain as much."""
    likely = [(r, e) for r, e in weighed.all if e.log_e > tau and e.gain > tau and not r.at_bound]
    if not likely:
        return settled_anew(state, weighed, ranking, tau, alpha)
    best, evidence = max(likely, key=lambda its: its[1].log_e)
    return settled_in(state, weighed, best, main_channel(evidence, best.term, state), tau, alpha)


def _at_an_end(
    state: State, weighed: Weighed, told: Collection[tuple], tau: float, alpha: float
) -> tuple[Refined, Evidence] | None:
    """What would hold but for a shape at the end of its range: something is there, and it is not this. told:
    keys of what was nearest to such before."""
    here = [(r, e) for r, e in weighed.all if r.at_bound and r.term.key not in told]
    inside = [(replace(r, at_bound=()), e) for r, e in here]
    ended = [(r, e) for r, e in inside if holds(state, weighed.metric, r, e, tau, alpha)]
    return max(ended, key=lambda its: its[1].log_e, default=None)


def _in_its_place(
    state: State, term: Term, ranking: Ranking, listed: Sequence[Ranked], tau: float, alpha: float
) -> Weighed:
    """All else that the joint of a term may lack, beside the term: what passed says more than it."""
    others = beside(ranking, listed, term.place.joint, tau, BUDGET - len(listed))
    weighed = compared(state, [Ranked(term, 0.0), *others], tau, alpha)
    own = max((e.log_e for r, e in weighed.all if r.term.key == term.key), default=0.0)
    return replace(weighed, passed=tuple((r, e) for r, e in weighed.passed if e.log_e > own))


def _ended(state: State, r: Refined, e: Evidence) -> Taken:
    """What such a shape stands for, without a name."""
    c = main_channel(e, r.term, state)
    read = tuple(sorted(signals_read(r.term) or ()))
    share = explained_share(state, c, r.columns[c] @ r.sizes)
    what = Unnamed(c, read, e.log_e, e.gain, share, Equivalent(r.term, e.log_e))
    return Taken(with_found(state, Found(None, r.columns, r.sizes, read)), what)


def _beside_a_second(
    state: State, weighed: Weighed, best: Refined, short: Short, library: Library, tau: float, alpha: float
) -> State | None:
    """The state with the best one, where another effect on the channel makes it sufficient after all: one of
    those weighed, or what the joint lacks beside it, both refined together; it is then at the shape that it
    has beside that, or it would stand for both. (A UR10e's first joint, whose friction grows with the square
    of its rate, and a Stribeck friction planted in it: each alone is short of functions of the rate. Of two
    Stribeck frictions of one joint the first, alone, left a second one that said less than a quadratic.)"""
    begun = refined_together(with_found(state, Found(best.term, best.columns, best.sizes)))
    for other, _ in weighed.all:
        if other.term.key == best.term.key or not set(other.columns) & set(best.columns):
            continue
        together, flex = weigh(short.metric, side_by_side(best.columns, other.columns)), short.flex
        more = margin(max(best.term.free, other.term.free), tau)
        judged, fitted = together.log_e - flex.evidence.log_e, together.gain - flex.fitted
        if min(judged, fitted) > more and together.supported(alpha):
            return begun
    others = frozenset(range(state.segments[0].q.shape[1])) - {best.term.place.joint}
    asked = compared(begun, short_list(ranked(begun, library, others)), tau, alpha).all
    likely = [r for r, e in asked if e.gain > tau and not r.at_bound and set(r.columns) & set(best.columns)]
    for other in likely[:SECOND]:
        first, second = refined_together(
            with_found(begun, Found(other.term, other.columns, other.sizes))
        ).found[-2:]
        if _say_as_much(first, second, short, tau, alpha):
            return solved(state.plus(first))
    return None


def _say_as_much(one: Found, other: Found, short: Short, tau: float, alpha: float) -> bool:
    """Whether two effects say as much as functions do."""
    columns = side_by_side(one.columns, other.columns)
    e, numbers = weigh(short.metric, columns), sum(f.term.free for f in (one, other) if f.term is not None)
    judged = as_much(e.log_e, short.flex.evidence.log_e, numbers, tau)
    return judged and as_much(e.gain, short.flex.fitted, numbers, tau) and e.supported(alpha)
