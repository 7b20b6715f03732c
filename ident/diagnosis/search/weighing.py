"""The hypotheses of one step, held against each other: what passes, what is simplest, what cannot be told
from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, unseen, weigh
from ident.diagnosis.evidence.given import given_fitted
from ident.diagnosis.evidence.leading import leading_metric
from ident.diagnosis.evidence.metric import Columns, Metric, side_by_side, spread
from ident.diagnosis.evidence.refine import Refined, refine
from ident.diagnosis.evidence.state import State
from ident.diagnosis.evidence.turning_rows import (
    beside_any_turn,
    turned_as_judged,
    turning_alone,
    without_turning,
)
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Ranked

WHOLE = 0.25  # by which the size of a change of the model may differ from one


@dataclass(frozen=True)
class Equivalent:
    """Another explanation that these data cannot reject, with its log E."""

    term: Term
    log_e: float


@dataclass(frozen=True)
class Weighed:
    """The hypotheses of one step in one metric; those that may be, and those that passed, best first.
    `turning`: of which that may be a part is shown by joints that turn round alone."""

    metric: Metric
    all: tuple[tuple[Refined, Evidence], ...]
    passed: tuple[tuple[Refined, Evidence], ...]
    possible: tuple[tuple[Refined, Evidence], ...] = ()
    turning: frozenset[tuple] = frozenset()  # keys


def compared(state: State, shortlist: Sequence[Ranked], tau: float, alpha: float) -> Weighed:
    """Refine, then weigh all in the noise that the best of them leaves."""
    m = state.metric
    begun = [(r, refine(state.plain_metric if r.plain else m, state.scene, r.term)) for r in shortlist]
    refined = [r for before, r in begun if r.columns and max(r.gain, before.gain) > 1.0]
    if not refined:
        return Weighed(m, (), ())
    m = leading_metric(state, refined)
    refined = [refine(m, state.scene, r.term, turns=2) for r in refined]
    refined = [_as_one_that_contains_it(m, state, r, refined) for r in refined]
    told = [(r, weigh(m, r.columns)) for r in refined]
    possible = [(r, e) for r, e in told if may_be(state, m, r, e, tau, alpha)]
    possible.sort(key=lambda item: -item[1].log_e)
    turning = frozenset(r.term.key for r, _ in possible if turning_alone(state, m, r))
    said = [(r, e) for r, e in possible if says_enough(r, e, tau, alpha) and r.term.key not in turning]
    as_judged = cache(partial(turned_as_judged, state, m))  # of each joint once
    passed = tuple((r, e) for r, e in said if beside_turn_over(as_judged, r, e, tau))
    return Weighed(m, tuple(told), passed, tuple(possible), turning)


def _as_one_that_contains_it(m: Metric, state: State, r: Refined, refined: Sequence[Refined]) -> Refined:
    """A law begun where one that contains it ended, too: their searches end in places of their own, and what
    is between them is not what the larger one has more. (Of a UR10e with friction under load beside another
    effect friction by quadrant was told, 43 nats ahead with both its coefficients 0.3.)"""
    for larger in refined:
        if larger.term.contains(r.term) and larger.gain > r.gain:
            shared = {name: x for name, x in larger.term.theta.items() if name in r.term.theta}
            again = refine(m, state.scene, r.term.at(**shared), turns=2)
            r = again if again.gain > r.gain else r
    return r


def simplest(weighed: Weighed, tau: float) -> tuple[Refined, Evidence]:
    """Of the explanations of the leading channels that the judged rows, or all, cannot tell from the best the
    one with fewest parameters; where the judged ones could not show what is between two, the fitted ones
    decide.
    (Weak hysteresis of an LWR4+: a Maxwell slip was 30 nats ahead on the fitted rows and none on the
    others.) Of a law that passed the simpler one that it contains is among them, whatever its blocks: that
    nothing is there has been rejected. (Of an AIRBOT's second joint friction by quadrant was told, 35.0 nats
    in enough blocks, where friction under load said 35.3 and a block too few agreed.)"""
    lead, most = weighed.passed[0]
    left_out = [
        (r, e)
        for r, e in weighed.passed
        if r.term.effect.replaces and r.term.place.joint == lead.term.place.joint
    ]
    if left_out:  # what the study itself took out of the model is there, and comes before what imitates it
        return left_out[0]
    asked = (*weighed.passed, *_contained(weighed))
    rows = int((weighed.metric.fitted.mask & weighed.metric.rows.use.any(axis=0)).sum())

    def fits(r: Refined, e: Evidence) -> float:  # each number chosen there is paid
        return e.gain - 0.5 * r.term.free * float(np.log(rows))

    every = fits(lead, most) + most.log_e
    equal = [
        (r, e)
        for r, e in asked
        if set(r.columns) & set(lead.columns)
        and (e.log_e > max(most.log_e - tau, tau) or (e.log_e > tau and fits(r, e) + e.log_e > every - tau))
    ]
    worth = [fits(r, e) for r, e in equal]
    first = equal[int(np.argmax(worth))]
    equal = [
        its
        for its, w in zip(equal, worth)
        if w > max(worth) - tau or not unseen(weighed.metric, _apart(its, first), np.ones(1), tau)
    ]
    return min(equal, key=lambda item: (*simplicity(item[0].term), -item[1].log_e))


def _contained(weighed: Weighed) -> list[tuple[Refined, Evidence]]:
    """What may be and did not pass itself, as something passed that contains it."""
    passed = {r.term.key: r.term for r, _ in weighed.passed}
    return [
        (r, e)
        for r, e in weighed.possible
        if r.term.key not in {*passed, *weighed.turning}
        and any(term.contains(r.term) for term in passed.values())
    ]


def best_held(
    held: Sequence[tuple[Refined, Evidence]], tau: float
) -> tuple[Refined, Evidence, tuple[tuple[Refined, Evidence], ...]] | None:
    """Of hypotheses that hold, each by rows of its own, the simplest of the best, and what else held on its
    channels; None of none."""
    if not held:
        return None
    most = max(e.log_e for _, e in held)
    equal = [(r, e) for r, e in held if e.log_e > most - tau]
    best = min(equal, key=lambda its: (*simplicity(its[0].term), -its[1].log_e))
    others = tuple(its for its in equal if its is not best and set(its[0].columns) & set(best[0].columns))
    return *best, others


def _apart(one: tuple[Refined, Evidence], other: tuple[Refined, Evidence]) -> Columns:
    """{channel: (M, 1)} what is between the torques of two explanations."""
    out: dict[int, np.ndarray] = {}
    for sign, (r, e) in ((1.0, one), (-1.0, other)):
        for c, z in r.columns.items():
            out[c] = out.get(c, 0.0) + sign * (z @ e.sizes)[:, None]
    return out


def simplicity(term: Term) -> tuple[int, bool]:
    """The simplest explanation has least of this: few numbers, whose motion it is among them, then an effect
    that many robots have."""
    return term.free + (term.place.source is not None), not term.effect.common


def holds(state: State, m: Metric, r: Refined, e: Evidence, tau: float, alpha: float) -> bool:
    """Everything that is asked of a hypothesis alone."""
    told = says_enough(r, e, tau, alpha) and may_be(state, m, r, e, tau, alpha)
    as_judged = partial(turned_as_judged, state, m)
    return told and not turning_alone(state, m, r) and beside_turn_over(as_judged, r, e, tau)


def beside_turn_over(as_judged: Callable[[int], Metric | None], r: Refined, e: Evidence, tau: float) -> bool:
    """Whether the judged rows ask for it with its joint's friction turning over as they want it. Shifts in
    time are asked of rows that do not turn; what the study itself left out needs no witness."""
    joint, effect = r.term.place.joint, r.term.effect
    if joint is None or effect.replaces or effect.shifts_time:
        return True
    its = as_judged(joint)
    return its is None or _asked_in(its, r, e, tau)


def _asked_in(m: Metric, r: Refined, e: Evidence, tau: float, sizes: np.ndarray | None = None) -> bool:
    """Whether a metric's rows ask for it, of some sizes or those that they want: by the judged ones alone, or
    given the fitted ones where that is what is told."""
    own = weigh(m, r.columns, sizes)
    if not e.given:
        return own.log_e > tau
    return bool(given_fitted(m, m.both, r.columns, own.sizes).per_channel.sum() > tau)


def may_be(state: State, m: Metric, r: Refined, e: Evidence, tau: float, alpha: float) -> bool:
    """Whether a hypothesis could be what is there, however little the judged rows say against nothing."""
    return (
        is_physical(state, m, r, e, tau)
        and is_itself(m, r, e, tau, alpha)
        and is_one_quantity(m, r, e, tau)
        and shifts_all(state, m, r, e, tau)
        and lowers(state.plain_metric, r, e)
    )


def says_enough(r: Refined, e: Evidence, tau: float, alpha: float) -> bool:
    """The judged rows reject the model without it, and block by block."""
    agreed = e.supported(alpha) or r.term.effect.replaces  # what the study itself left out needs no witness
    return bool(e.log_e > tau and agreed)


def is_physical(state: State, m: Metric, r: Refined, e: Evidence, tau: float) -> bool:
    """The fitted rows ask for it, with values that physics allows, or that they hold against it by less than
    tau nats."""
    names = r.term.effect.parameters_of(r.term.place)
    values = {**r.term.theta, **dict(zip(names, e.sizes))}
    if r.at_bound:
        return False
    if r.term.effect.changes_model and abs(e.sizes[-1] - 1.0) > WHOLE:
        return False  # its last column is the change as it is: all of it or none
    if not (e.gain > tau and e.left > 1e-5):
        return False
    if len(names) == 1:
        return r.term.effect.physical(values, state.model) is None
    return r.term.effect.against(values, spread(m, r.columns), r.term.place, state.model) < tau


def is_itself(m: Metric, r: Refined, e: Evidence, tau: float, alpha: float) -> bool:
    """Without the parameters that it may leave out it would not be this effect; without the others, it must
    say less. A change of the model says something of the parameters that the model has, too: those that it
    lets in are any law, times as small a change as you like (an offset left out of a TX40's first joint was
    told as a base that is turned by 0.03 degrees)."""
    if r.term.effect.changes_model:
        return weigh(m, {c: z[:, -1:] for c, z in r.columns.items()}).log_e > tau
    rest = r.term.optional
    if not rest:
        return True
    return e.beats(weigh(m, {c: z[:, rest] for c, z in r.columns.items()}), tau, alpha)


def is_one_quantity(m: Metric, r: Refined, e: Evidence, tau: float) -> bool:
    """A size that its shape measures as well must say enough as the shape has it. (Of a Barrett's first joint
    a link that lagged by 84 mrad in a gap of 12 was told as backlash.)"""
    shapes = r.term.effect.one_quantity
    at = {
        k: shapes[name] for k, name in enumerate(r.term.effect.parameters_of(r.term.place)) if name in shapes
    }
    sizes = np.array([r.term.theta[at[k]] if k in at else x for k, x in enumerate(e.sizes)])
    return not at or weigh(m, r.columns, sizes).log_e > tau


def shifts_all(state: State, m: Metric, r: Refined, e: Evidence, tau: float) -> bool:
    """A torque that comes at another time does so where the joint keeps its direction, too: as far from turns
    as they are felt, or, where the model's parameters have all rows that are left, beside whatever each turn
    may be. (20 ms of a TX40, whose runs last three seconds, left two to four rows of a torque.) And by as
    much as it is told there: turns that are wrong make more of it. (Of an arm whose torques were half a
    millisecond early, and whose friction turned before its joints, 4.5 ms were told.) Given the fitted rows
    it is not told where the judged ones reject what those want. (Of one in a force, whose friction yields,
    -8 ms were told: -22 by fitted rows that kept direction; the judged ones were 46 nats against that.)"""
    if not r.term.effect.shifts_time:
        return True
    away = without_turning(state, m, as_far_as_felt=True)
    hidden = e.log_e > tau and all(away.judged.free[c] <= 1.0 for c in r.columns)
    asked = beside_any_turn(state, m, float(e.sizes[0])) if hidden else away
    wants = weigh(asked, r.columns) if e.given else e  # at the size that those that are fitted want there
    return wants.log_e > -tau and _asked_in(asked, r, e, tau, e.sizes)


def lowers(plain: Metric, r: Refined, e: Evidence) -> bool:
    """The error itself falls on the judged rows, over the channels that say something: what a user sees. (By
    the one that says most alone a tilt of two degrees, which four of an LWR4+'s joints feel, was none.)"""
    return bool(weigh(plain, r.columns).per_channel[e.per_channel > 0].sum() > 0)


def main_channel(evidence: Evidence, term: Term, state: State) -> int:
    """Where it says most, among the channels that it acts in."""
    own = list(term.place.rows(state.model.channels)) or list(range(state.rows.channels))
    return max(own, key=lambda c: evidence.per_channel[c])


def rivals_of(
    weighed: Weighed, best: Refined, evidence: Evidence, tau: float, alpha: float
) -> tuple[Equivalent, ...]:
    """What may be there on its channels and is not beaten by it, without those that only add parameters to it
    and gain nothing by them, unless nothing could be gained: those are shown where a joint turns round alone.
    The model without any of them is rejected by the best one: what another says against that model, and in
    how many blocks, is no reason to reject it against the best. What leaves the best one all that it says
    explains another part of the residual. (Beside a wave of an upright joint's position, told of a base 14
    milliradians off, the base was left out: it says less of the judged rows, and more of all.)"""
    own = max((e.log_e for r, e in weighed.passed if r.term.key == best.term.key), default=0.0)

    def gains(r: Refined, e: Evidence) -> bool:
        says_more = e.log_e > own and not r.term.contains(best.term)
        return says_more or _pays(weighed.metric, (best, evidence), (r, e))

    return tuple(
        Equivalent(r.term, e.log_e)
        for r, e in weighed.possible
        if r.term.key != best.term.key
        and (r.term.free <= best.term.free or gains(r, e) or r.term.key in weighed.turning)
        and not evidence.beats(e, tau, alpha)
        and not _stays_beside(weighed.metric, (best, evidence), (r, e), tau, alpha)
        and (set(r.columns) & set(best.columns) or _same(weighed.metric, (best, evidence), (r, e), tau))
    )


def _pays(m: Metric, best: tuple[Refined, Evidence], other: tuple[Refined, Evidence]) -> bool:
    """Whether a law says more on all rows than the best one by what the numbers that it adds must: any noise
    lets one that contains it say a little more. (Beside four of fifteen Stribeck frictions one that fades as
    the joint warms was told, 0.4 nats ahead of 230.)"""
    (r, e), (its, x) = best, other
    rows = int(((m.fitted.mask | m.judged.mask) & m.rows.use.any(axis=0)).sum())
    more = x.gain + x.log_e - e.gain - e.log_e
    return more > 0.5 * (its.term.free - r.term.free) * np.log(rows)


def _same(m: Metric, best: tuple[Refined, Evidence], other: tuple[Refined, Evidence], tau: float) -> bool:
    """Whether two explanations on different channels are two of one thing: each alone says something, and
    beside the other neither does. (Of two torques whose factors differ either may be the wrong one.)"""
    (r, e), (its, x) = best, other
    together = weigh(m, side_by_side(r.columns, its.columns)).log_e
    return min(e.log_e, x.log_e) > tau and together - max(e.log_e, x.log_e) < tau


def nearly(
    weighed: Weighed, tau: float, alpha: float
) -> list[tuple[Refined, Evidence, tuple[Equivalent, ...]]]:
    """What lacks nothing but blocks that agree: of those that share a channel the one that says most, with
    what it does not beat. Blocks in which it hardly acts are coins; one that speaks against it is none: on a
    clean arm a backlash was 15 nats ahead, and 24 behind in a block where 12 were due."""
    asked = ((r, e) for r, e in weighed.possible if e.log_e > tau)
    likely = [(r, e) for r, e in asked if not e.supported(alpha) and not e.contradicted(alpha)]
    taken: set[int] = set()
    out = []
    for r, e in likely:
        if not taken & set(r.columns):
            out.append((r, e, tuple(q for q in rivals_of(weighed, r, e, tau, alpha) if q.log_e > tau)))
        taken |= set(r.columns)
    return out


def _stays_beside(
    m: Metric, best: tuple[Refined, Evidence], other: tuple[Refined, Evidence], tau: float, alpha: float
) -> bool:
    """Whether the judged rows ask for the best one with the other in the model, too: it is none in its place.
    (Beside a torque ripple of a UR10e, which reads the position, a law of the rate and the time was told that
    shared a hundredth of its torque.)"""
    (r, e), (its, x) = best, other
    if e.blocks.shape != x.blocks.shape:
        return False
    together = weigh(m, side_by_side(r.columns, its.columns))
    more = replace(e, log_e=together.log_e - x.log_e, blocks=together.blocks - x.blocks)
    return more.log_e > tau and more.supported(alpha)


def could_stand(weighed: Weighed, best: Refined, tau: float) -> tuple[Term, ...]:
    """What else could stand in its place; of what acts on the model's own torque all that says something, as
    the model beside it has been settled without it. Of two torques whose factors differ either may be it."""
    passed = {r.term.key for r, _ in weighed.possible}

    def stands(r: Refined, e: Evidence) -> bool:
        if set(r.columns) & set(best.columns):
            return r.term.key in passed or (r.term.size is not None and e.log_e > tau)
        return r.term.key in passed and e.log_e > tau and r.term.factor != 1.0 != best.term.factor

    return tuple(r.term for r, e in weighed.all if stands(r, e))
