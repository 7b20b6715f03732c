"""Loads that come and go: an undeclared body on a run or from a moment on, a contact for a while.

Windows are searched in steps: products of a unit load with the model, itself and the residual, summed over
short blocks once, give the gain of any window as small dense algebra; window lengths grow by a constant
ratio and their starts by a quarter of the length, so their number grows as the recording's. The best one's
edges are then moved. Every window tried counts in the limit; what is a load then is_a_load.py says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, Metric, acting, said, whole
from ident.diagnosis.evidence.leading import outside_metric, quiet
from ident.diagnosis.evidence.refine import Refined, fit_sizes, refine
from ident.diagnosis.evidence.state import Found, State, solved
from ident.diagnosis.loads.between_runs import between_runs, comparable, one_number_between, says_between
from ident.diagnosis.loads.is_a_load import (
    SHORTEST_S,
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
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.parameters_apart import times_noise
from ident.diagnosis.search.weighing import Equivalent
from modelgen.effects.effect import Effect
from modelgen.effects.place import Layout, Place

STEP_S = 0.5  # s: edges of the search
RATIO = 1.5  # of window lengths
TRIED = 8  # loads that are judged
EDGE = 2.0  # rows by which an edge is moved at first
TURNS = 4  # of a window and the noise outside it, until its edges stay
MARGIN_S = 1.0  # s from the ends, where a window would take up static friction


@dataclass(frozen=True, slots=True)
class Event:
    """A placed load with its window, judged by alternating blocks."""

    refined: Refined
    evidence: Evidence
    gain: float  # nats on all rows, in the noise of the model without it
    rivals: tuple[Event, ...] = ()  # on other links, or of another kind: not to be told apart


def best_event(
    state: State, effects: Sequence[Effect], layout: Layout, tau: float, alpha: float
) -> Event | None:
    """The load that explains most of any recording, if its blocks predict each other; alone, or beside
    another that holds beside it."""
    search = _search(state, effects, layout, tau)
    if search is None:
        return None
    held = [event for r in search.asked if (event := _held(state, r, search.limit, tau, alpha)) is not None]
    if held:
        told = _simplest(state, search.m, held, search.asked, tau)
        return _says_more(state, search, told, tau, alpha) or told
    return _beside_another(state, search, effects, layout, tau, alpha)


@dataclass(frozen=True)
class _Search:
    """The loads to judge, sized in a metric, and what they have to say."""

    m: Metric
    asked: tuple[Refined, ...]
    limit: float


def _search(state: State, effects: Sequence[Effect], layout: Layout, tau: float) -> _Search | None:
    loads = [effect for effect in effects if effect.windowed]
    if not loads:
        return None
    m = whole(state.metric, state.rows.usable)
    listed, tried = _likely(m, state, loads, layout, tau)
    asked = tuple(sized(m, term, columns, state) for term, columns in listed)
    return _Search(m, asked, tau + float(np.log(max(tried, 1))))


def _beside_another(
    state: State, search: _Search, effects: Sequence[Effect], layout: Layout, tau: float, alpha: float
) -> Event | None:
    """Of two loads, of which one comes and goes, that one, where each holds with the other in the model:
    fitted to the other one's rows, the model predicts none of its blocks. (Two contacts of an arm, 43 nats
    that the rest of the run contradicted by 17; a body on one run, and another one from a moment on in the
    next.)"""
    windows = [r for r in search.asked if r.gain > search.limit and _comes_and_goes(r.term.place)]
    first = max(windows, key=lambda r: r.gain, default=None)
    if first is None:
        return None
    beside = _with(state, first)
    others = _search(beside, effects, layout, tau)
    if others is None:
        return None
    for r in sorted(others.asked, key=lambda r: -r.gain):
        if r.gain < search.limit or _held(beside, r, search.limit, tau, alpha) is None:
            continue
        held = _held(_with(state, r), first, search.limit, tau, alpha)
        if held is not None:
            return held
    return None


def _comes_and_goes(place: Place) -> bool:
    return (place.start, place.stop) != (None, None)


def _with(state: State, r: Refined) -> State:
    return solved(state.plus(Found(r.term, r.columns, r.sizes)))


def sized(m: Metric, term: Term, columns: dict[int, np.ndarray], state: State) -> Refined:
    """A load with its window's edges, its shape and its size where all rows want them. (A force 8 cm before
    the flange, told at the flange, was no load: all of the model's parameters said more.)"""
    term, cut = _moved(m, term, columns, state)
    if term.effect.all_along or term.effect.nonlinear:  # at the size that it has: gravity is bent by degrees
        return refine(m, state.scene, term)
    return Refined(term, cut, *fit_sizes(m, cut))


def edged(m: Metric, state: State, r: Refined) -> Refined:
    """A load whose window opens and closes between the rows, where all of them want it: seen through their
    filter its edges are none of a row. (Of 12 N for three seconds an edge that is a tenth of a second off
    left 300 nats, and a force was told of that.)"""
    for which in ("start", "stop"):
        at = getattr(r.term.place, which)
        if at is None:
            continue
        reach = EDGE * state.rows.hop
        while reach > state.rows.hop / 8:
            now = getattr(r.term.place, which)
            trials = [r, *(_with_edge(m, state, r.term, which, now + way * reach) for way in (-1.0, 1.0))]
            best = max(trials, key=lambda its: its.gain if its.columns else -np.inf)
            reach, r = (reach / 2, r) if best is r else (reach, best)
    return r


def _with_edge(m: Metric, state: State, term: Term, which: str, at: float) -> Refined:
    place = replace(term.place, **{which: at})  # type: ignore[arg-type]
    moved = replace(term, place=place)
    columns = state.scene.columns(moved)
    return Refined(moved, columns, *(fit_sizes(m, columns) if columns else (np.zeros(0), -np.inf)))


def _in_noise_outside(state: State, r: Refined, limit: float) -> tuple[Metric, Refined]:
    """The noise outside a load's window, and the load in it, the window where all rows then want it: the
    noise of a model without the load is for the most part the load. As it was, where it says less than a
    limit there. (Of 3 N beside another contact the noise of both put an edge 0.2 s too early, where a block
    spoke against it.)"""
    wide: dict[int, np.ndarray] = {}
    for _ in range(TURNS):
        own = outside_metric(state, r, acting(r.columns))
        m = whole(own, state.rows.usable)
        r = Refined(r.term, r.columns, *fit_sizes(m, r.columns))
        if r.gain < limit or not _comes_and_goes(r.term.place):
            return own, r
        wide = wide or state.scene.columns(_window(r.term, None, None))  # its window alone is moved
        term, columns = _moved(m, _anew(m, r, wide, state), wide, state)
        if _as_before(r.term.place, term.place, state.rows.hop):
            break
        r = Refined(term, columns, *fit_sizes(m, columns))
    return own, edged(m, state, r)


def _anew(m: Metric, r: Refined, wide: dict[int, np.ndarray], state: State) -> Term:
    """The load in the window that says most of those that overlap its own, wherever their edges are. (The
    last three seconds of a contact of six were told, as long as its noise was that of the first three.)"""
    place = r.term.place
    windows, gains = _windows(m, wide, state, place, True, False)
    begun, ended = _ends(place.start, place.stop)
    for k in np.argsort(-gains):
        start, stop = _ends(*windows[k])
        if gains[k] > r.gain and start < ended and begun < stop:
            return _window(r.term, *windows[k])
    return r.term


def _ends(start: float | None, stop: float | None) -> tuple[float, float]:
    return (-np.inf if start is None else start), (np.inf if stop is None else stop)


def _as_before(one: Place, other: Place, hop: float) -> bool:
    """Whether two windows have the same edges, but for a row."""
    pairs = ((one.start, other.start), (one.stop, other.stop))
    return all(a is None or b is None or abs(a - b) < hop for a, b in pairs)


def _held(state: State, r: Refined, limit: float, tau: float, alpha: float) -> Event | None:
    """The load as the rows of its recording judge it; None where they do not say that it is one."""
    possible = _possible(state, r, limit, tau)
    if possible is None:
        return None
    own, its = possible
    term, columns, sizes = its.term, its.columns, its.sizes
    if term.effect.transient and not _comes(state, own, its, tau):
        return None
    if not (away_from_turns(state, own, columns, tau) and stands_apart(state, own, term, columns, limit)):
        return None
    halves, evidence = _crosswise(state, own, its)
    told = evidence.log_e > limit and said(whole(own, state.rows.usable), columns, sizes) > limit
    if told and as_one_number(state, halves, term, columns, evidence, tau):
        return None
    told = told and by_what_it_needs(halves, term, columns, evidence, tau, alpha)
    runs = comparable(state, term, columns)
    if told and evidence.supported(alpha) and is_load(state, halves, columns, evidence, limit, alpha):
        if runs and one_number_between(state, term, columns, tau, crosswise(halves, columns)):
            return None
        return Event(its, evidence, r.gain)
    nats = between_runs(state, term, columns, limit, tau) if runs else None
    return None if nats is None else Event(its, replace(evidence, log_e=nats), r.gain)


def _possible(state: State, r: Refined, limit: float, tau: float) -> tuple[Metric, Refined] | None:
    """The noise outside a load and the load in it, where it says enough there and may be one."""
    own, its = _in_noise_outside(state, r, limit)
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
    always = state.scene.columns(_window(r.term, None, None))
    return r.gain > fit_sizes(whole(own, state.rows.usable), always)[1] + tau


def _likely(
    m: Metric, state: State, loads: Sequence[Effect], layout: Layout, tau: float
) -> tuple[list[tuple[Term, dict[int, np.ndarray]]], int]:
    """The loads to judge, each with its best window and its columns, and how many windows were tried.

    The noise at hand is that of a model without the load. A load on a whole run, which the model's own
    parameters answer half, is most of it: in that noise a weight on a Franka's second link came 27th.
    So loads on whole runs are also ranked each by the noise that it leaves, and by what the runs have in
    common: of a weight on an LWR4+'s second link, whose mirror on the other run is as quiet, that is told."""
    done = {term.key for term in state.terms}
    plain = whole(state.plain_metric, state.rows.usable)
    found: list[tuple[float, Term, dict[int, np.ndarray]]] = []
    all_along: list[tuple[float, Term, dict[int, np.ndarray]]] = []
    in_common: list[tuple[float, Term, dict[int, np.ndarray]]] = []
    says, tried = says_between(state), 0
    for effect in loads:
        for place in effect.places(layout):
            if place.recording is None or _role(state, place) == "test":
                continue
            term = Term(effect, place, dict(_first(effect, place, state))).beside(done)
            only_whole = _only_whole(effect, place, layout)
            columns = {} if term.copy and only_whole else state.scene.columns(term)
            if not columns:
                continue
            windows, gains = _windows(m, columns, state, place, _part_alone(state, effect), only_whole)
            tried += len(windows)
            if not len(windows):
                continue
            k = int(np.argmax(gains))
            if gains[k] > tau:
                found = _best([*found, (float(gains[k]), _window(term, *windows[k]), columns)])
            if (None, None) in windows:
                all_along = _best([*all_along, (quiet(plain, columns), term, columns)])
                if comparable(state, term, columns) and (nats := says(columns)) > tau:
                    in_common = _best([*in_common, (nats, term, columns)])
    best = (*all_along, *found, *in_common)
    listed = {(t.key, t.place.start, t.place.stop): (t, columns) for _, t, columns in best}
    return list(listed.values()), tried


def _best(
    ranked: Sequence[tuple[float, Term, dict[int, np.ndarray]]],
) -> list[tuple[float, Term, dict[int, np.ndarray]]]:
    return sorted(ranked, key=lambda item: -item[0])[:TRIED]  # their columns are large


def _simplest(state: State, m: Metric, held: Sequence[Event], asked: Sequence[Refined], tau: float) -> Event:
    """Of the loads of the recording that says most which these data cannot tell apart, the one with fewest
    parameters, its window's edges among them; the others stand beside it, and its mirrors on other runs."""
    most = max(held, key=lambda event: event.evidence.log_e)
    mirrored = [e for e in held if _mirrors(e.refined.term, most.refined.term)]
    most = max((most, *mirrored), key=lambda event: event.gain)
    run = most.refined.term.place.recording
    near = most.evidence.log_e - tau
    equal = [e for e in held if e.evidence.log_e > near and e.refined.term.place.recording == run]
    best = min(equal, key=lambda event: (chosen(event.refined.term), -event.evidence.log_e))
    its = best.refined.term  # with more or fewer of its parameters it is no other explanation
    others = [e for e in equal if what(e.refined.term) != what(its)]
    mirrors = [r for r in asked if _mirrors(r.term, its)]
    apart = times_noise(state.metric, best.refined.columns, best.refined.sizes) if mirrors else 1.0
    for r in mirrors:
        if r.gain > best.gain - apart * tau and can_be(state, m, r.term, r.columns, r.sizes, tau):
            others.append(Event(r, best.evidence, r.gain))
    return replace(best, rivals=tuple(others))


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
        if (
            evidence.log_e > told.evidence.log_e + tau
            and by_what_it_needs(halves, best.term, best.columns, evidence, tau, alpha)
            and is_load(state, halves, best.columns, evidence, search.limit, alpha)
        ):
            more.append(Event(best, evidence, r.gain, (told, *told.rivals)))
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


def _role(state: State, place: Place) -> str:
    return state.rows.roles[state.rows.names.index(str(place.recording))]


def _first(effect: Effect, place: Place, state: State) -> dict[str, float]:
    starts = effect.starts(place, state.motions, [np.zeros(len(m.t)) for m in state.motions], state.model)
    return dict(starts[0]) if starts else {}


def _only_whole(effect: Effect, place: Place, layout: Layout) -> bool:
    """Bodies on inner links are looked for on whole recordings, as is what is there all along one."""
    return effect.all_along or (place.link is not None and place.link != layout.robot.payload_link("L"))


def _part_alone(state: State, effect: Effect) -> bool:
    """Whether it may act in a part of a recording alone: on the only one a load all along is the model's."""
    return effect.transient or sum(r != "test" for r in state.rows.roles) < 2


def _window(term: Term, start: float | None, stop: float | None) -> Term:
    return replace(term, place=replace(term.place, start=start, stop=stop))


def _since(state: State, place: Place) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a place's recording and their time since its first sample."""
    number = state.rows.names.index(str(place.recording))
    mine = np.flatnonzero(state.rows.recording == number)
    begun = next(s.begun for s in state.segments if s.label == place.recording)
    return mine, state.rows.t[mine] - begun


def _windows(
    m: Metric, columns: dict[int, np.ndarray], state: State, place: Place, part: bool, only_whole: bool
) -> tuple[list[tuple[float | None, float | None]], np.ndarray]:
    mine, t = _since(state, place)
    if len(t) < 20:
        return [], np.zeros(0)
    cells = np.unique(np.floor(t / STEP_S))  # a pause is one block, however long
    edges = np.union1d(cells, cells + 1) * STEP_S
    sums = _sums(m, columns, mine, t, edges)
    B = len(edges) - 1
    pairs: list[tuple[int, int]] = [(0, B)]
    if not only_whole:
        least, margin = int(SHORTEST_S / STEP_S), int(MARGIN_S / STEP_S)
        length = float(least)
        while length < 0.7 * B:
            n = round(length)
            pairs += [(a, a + n) for a in range(margin, B - n - margin + 1, max(1, n // 4))]
            length *= RATIO
        pairs += [(a, B) for a in range(least, B - least + 1)]
    if part:
        pairs = pairs[1:]
    if not pairs:
        return [], np.zeros(0)
    chosen = np.array(pairs)
    gains = _gains(sums, chosen)
    windows = [(None if a == 0 else float(edges[a]), None if b == B else float(edges[b])) for a, b in chosen]
    return windows, gains


def _sums(
    m: Metric, columns: dict[int, np.ndarray], mine: np.ndarray, t: np.ndarray, edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cumulative products over the blocks between edges: with the model (B+1, r, p), own, with the
    residual."""
    p = next(iter(columns.values())).shape[1]
    r, B = m.fitted.basis.shape[1], len(edges) - 1
    block = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, B - 1)
    cross, own, right = np.zeros((B, r, p)), np.zeros((B, p, p)), np.zeros((B, p))
    firsts = np.searchsorted(block, np.arange(B + 1))
    for c, z in columns.items():
        white = (m.whiteners[c] @ z)[mine] * (m.fitted.mask & m.rows.use[c])[mine, None]
        places, values = m.X[c]
        X = values[mine] @ m.fitted.basis[places]
        e = m.fitted.residual[c, mine]
        for k in range(B):
            s = slice(firsts[k], firsts[k + 1])
            if s.stop > s.start:
                cross[k] += X[s].T @ white[s]
                own[k] += white[s].T @ white[s]
                right[k] += white[s].T @ e[s]

    def cumulative(a: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros((1, *a.shape[1:])), np.cumsum(a, axis=0)])

    return cumulative(cross), cumulative(own), cumulative(right)


def _gains(sums: tuple[np.ndarray, np.ndarray, np.ndarray], pairs: np.ndarray) -> np.ndarray:
    cross, own, right = sums
    a, b = pairs[:, 0], pairs[:, 1]
    x, g, h = cross[b] - cross[a], own[b] - own[a], right[b] - right[a]
    left = g - np.swapaxes(x, 1, 2) @ x
    scale = np.sqrt(np.maximum(np.einsum("kii->ki", g), 1e-300))
    normal = left / scale[:, :, None] / scale[:, None, :] + 1e-6 * np.eye(g.shape[1])
    told = h / scale
    size = np.linalg.solve(normal, told[:, :, None])[:, :, 0]
    return 0.5 * np.einsum("ki,ki->k", size, told)


def _moved(
    m: Metric, term: Term, columns: dict[int, np.ndarray], state: State
) -> tuple[Term, dict[int, np.ndarray]]:
    """The window's edges where the gain is largest, by rows, one edge after the other; none where that is an
    end of the recording. (Edges before the first row gain as much as it: a body on a whole run of an AIRBOT
    was told as a force from -8.5 s on.)"""
    mine, t = _since(state, term.place)
    part = _part_alone(state, term.effect)
    ends = [term.place.start, term.place.stop]
    here, own = m.only(mine), {c: z[mine] for c, z in columns.items()}  # zero in the other recordings

    def inside(start: float | None, stop: float | None) -> np.ndarray:
        after = t >= (start if start is not None else -np.inf)
        return np.asarray(after & (t < (stop if stop is not None else np.inf)))

    def gain(start: float | None, stop: float | None) -> float:
        kept = inside(start, stop)
        if part and kept.all():
            return 0.0
        return fit_sizes(here, {c: z * kept[:, None] for c, z in own.items()})[1]

    for _ in range(2):
        for which in (0, 1):
            if ends[which] is None:
                continue
            near = float(ends[which] or 0.0) + np.arange(
                -2 * STEP_S, 2.01 * STEP_S, max(state.rows.hop, 0.05)
            )
            gains = []
            for edge in near:
                trial = list(ends)
                trial[which] = float(edge)
                wide = (trial[1] if trial[1] is not None else np.inf) - (trial[0] or 0.0)
                gains.append(gain(*trial) if wide > 0.5 * SHORTEST_S else 0.0)
            ends[which] = float(near[int(np.argmax(gains))])
    if ends[0] is not None and ends[0] <= t.min():
        ends[0] = None
    if ends[1] is not None and ends[1] > t.max():
        ends[1] = None
    rows = np.zeros(len(state.rows.t), bool)
    rows[mine] = inside(ends[0], ends[1])
    return _window(term, ends[0], ends[1]), {c: z * rows[:, None] for c, z in columns.items()}
