"""Loads that come and go: an undeclared body on a run or from a moment on, a contact for a while.

Windows are searched in steps (windows.py), and the best one's edges moved (edges.py). Every window tried
counts in the limit; what is a load then is_a_load.py says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, said
from ident.diagnosis.evidence.leading import quiet
from ident.diagnosis.evidence.metric import Metric, acting, whole
from ident.diagnosis.evidence.refine import Refined, fit_sizes, refine
from ident.diagnosis.evidence.state import Found, State, solved
from ident.diagnosis.loads.between_runs import between_runs, comparable, one_number_between, says_between
from ident.diagnosis.loads.edges import in_noise_outside, moved
from ident.diagnosis.loads.is_a_load import (
    as_one_number,
    away_from_turns,
    by_what_it_needs,
    can_be,
    cross_evidence,
    crosswise,
    halves_of,
    is_load,
    stands_apart,
)
from ident.diagnosis.loads.windows import part_alone, windows_of, with_window
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Library
from ident.diagnosis.search.parameters_apart import times_noise
from ident.diagnosis.search.weighing import Equivalent
from modelgen.effects.effect import Effect
from modelgen.effects.place import Layout, Place

TRIED = 8  # loads that are judged

_Told = tuple[float, Term]  # what it says [nats]


@dataclass(frozen=True, slots=True)
class Event:
    """A placed load with its window, judged by alternating blocks."""

    refined: Refined
    evidence: Evidence
    gain: float  # nats on all rows, in the noise of the model without it
    rivals: tuple[Event, ...] = ()  # on other links, or of another kind: not to be told apart
    noise: Metric | None = field(default=None, repr=False, compare=False)  # in which its blocks are judged


def best_event(
    state: State, library: Library, tau: float, alpha: float, layout: Layout | None = None
) -> Event | None:
    """The load that explains most of any recording (of a `layout`, where one is given), if its blocks predict
    each other; alone, or beside another that holds beside it."""
    layout = layout or library.layout
    search = _search(state, library, layout, tau)
    if search is None:
        return None
    held = [event for r in search.asked if (event := _held(state, r, search.limit, tau, alpha)) is not None]
    if held:
        told = _simplest(state, search.m, held, search.asked, tau)
        return _says_more(state, search, told, tau, alpha) or told
    return _beside_another(state, search, library, layout, tau, alpha)


@dataclass(frozen=True)
class _Search:
    """The loads to judge, sized in a metric, and what they have to say."""

    m: Metric
    asked: tuple[Refined, ...]
    limit: float


def _search(state: State, library: Library, layout: Layout, tau: float) -> _Search | None:
    if not library.events:
        return None
    m = whole(state.metric, state.rows.usable)
    listed, tried = _likely(m, state, library, layout, tau)
    asked = tuple(sized(m, term, _all_along(state, term), state) for term in listed)
    return _Search(m, asked, tau + float(np.log(max(tried, 1))))


def _beside_another(
    state: State, search: _Search, library: Library, layout: Layout, tau: float, alpha: float
) -> Event | None:
    """Of two loads, of which one comes and goes, that one, where each holds with the other in the model:
    fitted to the other one's rows, the model predicts none of its blocks. (Two contacts of an arm, 43 nats
    that the rest of the run contradicted by 17; a body on one run, and another one from a moment on in the
    next.)"""
    windows = [r for r in search.asked if r.gain > search.limit and r.term.place.comes_and_goes]
    first = max(windows, key=lambda r: r.gain, default=None)
    if first is None:
        return None
    beside = _with(state, first)
    others = _search(beside, library, layout, tau)
    if others is None:
        return None
    for r in sorted(others.asked, key=lambda r: -r.gain):
        if r.gain < search.limit or _held(beside, r, search.limit, tau, alpha) is None:
            continue
        held = _held(_with(state, r), first, search.limit, tau, alpha)
        if held is not None:
            return held
    return None


def _with(state: State, r: Refined) -> State:
    return solved(state.plus(Found(r.term, r.columns, r.sizes)))


def sized(m: Metric, term: Term, columns: dict[int, np.ndarray], state: State) -> Refined:
    """A load with its window's edges, its shape and its size where all rows want them. (A force 8 cm before
    the flange, told at the flange, was no load: all of the model's parameters said more.)"""
    term, cut = moved(m, term, columns, state)
    if term.effect.all_along or term.effect.nonlinear:  # at the size that it has: gravity is bent by degrees
        return refine(m, state.scene, term)
    return Refined(term, cut, *fit_sizes(m, cut))


def _held(state: State, r: Refined, limit: float, tau: float, alpha: float) -> Event | None:
    """The load as the rows of its recording judge it; None where they do not say that it is one."""
    possible = _possible(state, r, limit, tau)
    if possible is None:
        return None
    own, its = possible
    if its.term.effect.transient and not _comes(state, own, its, tau):
        return None
    if not stands_apart(state, own, its.term, its.columns, limit):
        return None
    told = _told(state, own, its, r.gain, limit, tau, alpha)  # before what takes as long as all the rest
    return told if told is not None and away_from_turns(state, own, its.columns, tau) else None


def _told(
    state: State, own: Metric, its: Refined, gain: float, limit: float, tau: float, alpha: float
) -> Event | None:
    """The load by what alternating blocks foretell of each other, or the runs of each other."""
    term, columns, sizes = its.term, its.columns, its.sizes
    halves, evidence = _crosswise(state, own, its)
    told = evidence.log_e > limit and said(whole(own, state.rows.usable), columns, sizes) > limit
    if told and as_one_number(state, halves, term, columns, evidence, tau):
        return None
    told = told and by_what_it_needs(halves, term, columns, evidence, tau, alpha)
    runs = comparable(state, term, columns)
    if told and evidence.supported(alpha) and is_load(state, halves, columns, evidence, limit, alpha):
        if runs and one_number_between(state, term, columns, tau, crosswise(halves, columns)):
            return None
        return Event(its, evidence, gain, noise=own)
    nats = between_runs(state, term, columns, limit, tau) if runs else None
    return None if nats is None else Event(its, replace(evidence, log_e=nats), gain)


def _possible(state: State, r: Refined, limit: float, tau: float) -> tuple[Metric, Refined] | None:
    """The noise outside a load and the load in it, where it says enough there and may be one."""
    own, its = in_noise_outside(state, r, limit)
    enough = its.gain >= limit and can_be(state, own, its.term, its.columns, its.sizes, tau)
    return (own, its) if enough else None


def _crosswise(state: State, own: Metric, r: Refined) -> tuple[tuple[Metric, Metric], Evidence]:
    """Alternating blocks in a load's noise, and what they say of it."""
    halves = halves_of(state, own, r.columns)
    return halves, cross_evidence(halves, r.columns, acting(r.columns))


def _comes(state: State, own: Metric, r: Refined, tau: float) -> bool:
    """Whether what comes and goes says more than it would all along its recording: what was there before is
    no contact. (Half a kilogram at an AIRBOT's flange throughout a run in coarse encoder steps, whose
    inertial forces these drown, was told as a force of its weight on all but the first second.)"""
    always = _all_along(state, r.term)
    return r.gain > fit_sizes(whole(own, state.rows.usable), always)[1] + tau


def _all_along(state: State, term: Term) -> dict[int, np.ndarray]:
    """Columns of a load as if it were there all along its recording."""
    return state.scene.columns(with_window(term, None, None))


def _likely(m: Metric, state: State, library: Library, layout: Layout, tau: float) -> tuple[list[Term], int]:
    """The loads to judge, each with its best window, and how many windows were tried.

    The noise at hand is that of a model without the load. A load on a whole run, which the model's own
    parameters answer half, is most of it: in that noise a weight on a Franka's second link came 27th.
    So loads on whole runs are also ranked each by the noise that it leaves, and by what the runs have in
    common: of a weight on an LWR4+'s second link, whose mirror on the other run is as quiet, that is told."""
    done = {term.key for term in state.terms}
    plain = whole(state.plain_metric, state.rows.usable)
    found, all_along, in_common = list[_Told](), list[_Told](), list[_Told]()
    says, tried = says_between(state), 0
    for effect in library.events:
        for place in effect.places(layout):
            if place.recording is None:
                continue
            term = Term(effect, place, dict(_first(effect, place, state))).beside(done)
            only_whole = _only_whole(effect, place, layout)
            columns = {} if term.copy and only_whole else library.columns(state, term)
            if not columns:
                continue
            windows, gains = windows_of(m, columns, state, place, part_alone(state, effect), only_whole)
            tried += len(windows)
            if not len(windows):
                continue
            k = int(np.argmax(gains))
            if gains[k] > tau:
                found.append((float(gains[k]), with_window(term, *windows[k])))
            if (None, None) in windows:
                all_along.append((quiet(plain, columns), term))
                if comparable(state, term, columns) and (nats := says(columns)) > tau:
                    in_common.append((nats, term))
    best = chain.from_iterable(_best(ranked) for ranked in (all_along, found, in_common))
    return list({(t.key, t.place.start, t.place.stop): t for _, t in best}.values()), tried


def _best(ranked: Sequence[_Told]) -> list[_Told]:
    return sorted(ranked, key=lambda item: -item[0])[:TRIED]


def _simplest(state: State, m: Metric, held: Sequence[Event], asked: Sequence[Refined], tau: float) -> Event:
    """Of the loads of the recording that says most which these data cannot tell apart, in the noise of that
    one, the one with fewest parameters, its window's edges among them; the others stand beside it, and its
    mirrors on other runs. (Of 27 g in a flange a force of their weight was told: 929 nats, 911 for a body in
    the noise outside of that, and 930 in one noise.)"""
    most = max(held, key=lambda event: event.evidence.log_e)
    mirrored = [e for e in held if _mirrors(e.refined.term, most.refined.term)]
    most = max((most, *mirrored), key=lambda event: event.gain)
    run = most.refined.term.place.recording
    near = most.evidence.log_e - tau
    here = [e for e in held if e.refined.term.place.recording == run]
    equal = [e for e in here if e is most or _in_noise_of(state, most, e) > near]
    likely = _worth_most(state, most, equal, tau)
    best = min(likely, key=lambda event: (chosen(event.refined.term), -event.evidence.log_e))
    its = best.refined.term  # with more or fewer of its parameters it is no other explanation
    others = [e for e in equal if what(e.refined.term) != what(its)]
    mirrors = [r for r in asked if _mirrors(r.term, its)]
    apart = times_noise(state.metric, best.refined.columns, best.refined.sizes) if mirrors else 1.0
    for r in mirrors:
        if r.gain > best.gain - apart * tau and can_be(state, m, r.term, r.columns, r.sizes, tau):
            others.append(Event(r, best.evidence, r.gain))
    return replace(best, rivals=tuple(others))


def _worth_most(state: State, most: Event, equal: Sequence[Event], tau: float) -> list[Event]:
    """Of loads that blocks do not tell apart those that all rows do not either, in the noise of the one that
    says most, each number that was chosen for them paid. (Of a body that another one joins a force until then
    was told: blocks foretold each other as well by it, with three numbers less, and all rows 500 nats
    worse.)"""
    if most.noise is None:
        return list(equal)
    every = whole(most.noise, state.rows.usable)
    price = 0.5 * float(np.log(every.fitted.mask.sum()))
    worth = [fit_sizes(every, e.refined.columns)[1] - price * chosen(e.refined.term) for e in equal]
    return [e for e, nats in zip(equal, worth) if nats > max(worth) - tau]


def _in_noise_of(state: State, one: Event, other: Event) -> float:
    """log E [nats] of another load in the noise of one; what runs say of each other has none of its own."""
    if one.noise is None or other.noise is None:
        return other.evidence.log_e
    return _crosswise(state, one.noise, other.refined)[1].log_e


def _says_more(state: State, search: _Search, told: Event, tau: float, alpha: float) -> Event | None:
    """Another load of the same rows that says more than the one that is told, if in too few blocks to be told
    by itself: that one is there the other shows, which stands beside it. (Of 2 kg at the flange of a TX40
    whose runs last three seconds 1.6 kg were told of the link before: 44 nats, and 61 of the last one.)"""
    its, more = told.refined.term, list[Event]()
    for r in search.asked:
        same = (r.term.place.recording, r.term.place.start, r.term.place.stop)
        if same != (its.place.recording, its.place.start, its.place.stop) or what(r.term) == what(its):
            continue
        possible = _possible(state, r, search.limit, tau)
        if possible is None:
            continue
        own, best = possible
        halves, evidence = _crosswise(state, own, best)
        other, least = Event(best, evidence, r.gain, (told, *told.rivals), own), evidence.log_e - tau
        if (
            told.evidence.log_e < least
            and _in_noise_of(state, other, told) < least
            and by_what_it_needs(halves, best.term, best.columns, evidence, tau, alpha)
            and is_load(state, halves, best.columns, evidence, search.limit, alpha)
        ):
            more.append(other)
    return max(more, key=lambda event: event.evidence.log_e, default=None)


def others_of(event: Event) -> tuple[Equivalent, ...]:
    """What is not to be told from it."""
    return tuple(Equivalent(x.refined.term, x.evidence.log_e) for x in event.rivals)


def what(term: Term) -> tuple[Effect, int | None, int | None]:
    """The kind of a load, and what it is on."""
    return term.effect, term.place.joint, term.place.link


def _mirrors(one: Term, other: Term) -> bool:
    """Whether it is the same on another run, and may be the other way round. A run's own rows do not
    tell which: what is on it is answered by parameters that it alone decides. (Five degrees of another
    zero on the one fitted run of a UR10e: 185 nats by its own rows, 803 by those of the run that judges.)
    What one of them is ahead by on all rows counts by what the parameters change by beside it from run
    to run: of 20 degrees in the one fitted run of a TX40, whose two runs of three seconds a model of 9 %
    predicts, the run that judges was ahead by 24 nats."""
    return what(one) == what(other) and one.place.recording != other.place.recording


def chosen(term: Term) -> int:
    """Numbers that the data choose: parameters and the edges of its window."""
    return term.free + sum(edge is not None for edge in (term.place.start, term.place.stop))


def _first(effect: Effect, place: Place, state: State) -> dict[str, float]:
    starts = effect.starts(place, state.motions, [np.zeros(len(m.t)) for m in state.motions], state.model)
    return dict(starts[0]) if starts else {}


def _only_whole(effect: Effect, place: Place, layout: Layout) -> bool:
    """Bodies on inner links are looked for on whole recordings, as is what is there all along one."""
    return effect.all_along or (place.link is not None and place.link != layout.robot.payload_link("L"))
