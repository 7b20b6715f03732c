"""Loads that come and go: an undeclared body on a run or from a moment on, a contact for a while.

Windows are searched in steps: products of a unit load with the model, itself and the residual, summed over
short blocks once, give the gain of any window as small dense algebra; window lengths grow by a constant
ratio and their starts by a quarter of the length, so their number grows as the recording's. The best one's
edges are then moved. Rows of an event are in one recording alone, so it is judged there: alternating blocks
of all rows, each predicted from the other half. Every window tried counts in the limit.

A model that is wrong elsewhere is wrong on one run in its own way, and a body's ten parameters take that up.
So a load has to hold beside the run's own friction (days differ), and all of the model's parameters, free in
that window, must not say more than it does (sufficiency: a load is among the changes that they can make)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.evidence import Columns, Evidence, Metric, orthonormal, project, side_of, weigh
from ident.diagnosis.leading import outside_metric, quiet
from ident.diagnosis.refine import Refined, fit_sizes
from ident.diagnosis.state import Found, State, solved
from ident.diagnosis.sufficiency import NEARLY
from ident.diagnosis.terms import Term
from modelgen.effects.effect import Effect
from modelgen.effects.place import Layout, Place
from modelgen.geometry.names import ParameterName

STEP_S = 0.5  # s: edges of the search
FOLD_S, SHORTEST_FOLD_S = 1.0, 0.25  # s: blocks that predict each other
FOLDS = 12  # of a window, where it is short
SHORTEST_S = 1.5
RATIO = 1.5  # of window lengths
TRIED = 8  # loads that are judged
MARGIN_S = 1.0  # s from the ends, where a window would take up static friction


@dataclass(frozen=True, slots=True)
class Event:
    """A placed load with its window, judged by alternating blocks."""

    refined: Refined
    evidence: Evidence
    rivals: tuple[Event, ...] = ()  # on other links, or of another kind: not to be told apart


def crossed(m: Metric, usable: np.ndarray, fold_s: float) -> tuple[Metric, Metric]:
    """The same noise with alternating blocks fitted and judged, and the other way round."""
    rows = m.rows
    even = (np.floor(rows.t / fold_s).astype(int) + rows.recording) % 2 == 0
    sides = [side_of(rows, m.X, m.y, m.B, usable & half) for half in (even, ~even)]
    return replace(m, fitted=sides[0], judged=sides[1]), replace(m, fitted=sides[1], judged=sides[0])


def whole(m: Metric, usable: np.ndarray) -> Metric:
    """Everything usable fitted."""
    side = side_of(m.rows, m.X, m.y, m.B, usable)
    return replace(m, fitted=side, judged=side)


def acting(columns: Mapping[int, np.ndarray]) -> np.ndarray:
    """(M,) rows in which columns are not zero."""
    return np.asarray(np.any([np.any(z, axis=1) for z in columns.values()], axis=0))


def own_columns(state: State, inside: np.ndarray, chosen: Collection[int]) -> dict[int, np.ndarray]:
    """Of the model's parameters those chosen, free in a window (M,)."""
    free = np.sort(list(chosen))
    out = {}
    for c, (places, values) in enumerate(state.rows.base):
        z = np.zeros((len(inside), len(free)))
        mine = np.isin(places, free)
        z[:, np.searchsorted(free, places[mine])] = values[:, mine] * inside[:, None]
        out[c] = z
    return out


def drives_of(state: State) -> list[tuple[int, ...]]:
    """Places of the parameters of each joint's drive among the model's; what is no body's is a drive's."""
    drives: dict[str, tuple[int, ...]] = {}
    for k, name in enumerate(state.problem.columns.parameters):
        parsed = ParameterName.of(name)
        if parsed is None or not parsed.of_body:
            joint = "" if parsed is None else parsed.label
            drives[joint] = (*drives.get(joint, ()), k)
    return list(drives.values())


def halves_of(state: State, m: Metric, columns: Mapping[int, np.ndarray]) -> tuple[Metric, Metric]:
    """Alternating blocks of the usable rows, short enough that a dozen of them lie in the window."""
    fold = float(np.clip(acting(columns).sum() * state.rows.hop / FOLDS, SHORTEST_FOLD_S, FOLD_S))
    return crossed(m, state.rows.usable, fold)


def still_holds(state: State, f: Found, tau: float, alpha: float) -> bool:
    """Of a load found before: beside all that was found since (the state is without it)."""
    assert f.term is not None
    own = outside_metric(state, Refined(f.term, f.columns, f.sizes, 0.0), acting(f.columns))
    sizes, _ = fit_sizes(whole(own, state.rows.usable), f.columns)
    if f.term.effect.windowed and not can_be(state, own, f.term, f.columns, sizes, tau):
        return False
    halves = halves_of(state, own, f.columns)
    evidence = cross_evidence(halves, f.columns, acting(f.columns))
    if f.term.effect.windowed and as_another_zero(state, halves, f.term, f.columns, evidence, tau):
        return False
    return is_load(state, halves, f.columns, tau, alpha)


def is_load(state: State, halves: tuple[Metric, Metric], columns: Columns, tau: float, alpha: float) -> bool:
    """It says something beside the window's own friction, or alone no less than that with fewer numbers; and
    all of the model's parameters say hardly more than it (NEARLY, as of any law: what its columns are wrong
    by grows with it), if only where all noise is white. (A contact of 4 N and 2 s on a UR10e says 1366 nats,
    the friction of six drives 1317, both 1332: what these learn of it is their price.)"""
    inside = acting(columns)
    drives, friction = own_friction(state, halves, inside)
    beside = {c: np.hstack([z, own]) for c, z, own in _together(columns, drives)}
    alone, load = (cross_evidence(halves, z, inside) for z in (columns, beside))
    every = own_columns(state, inside, range(state.rows.b))
    whole = cross_evidence(halves, every, inside)
    simpler = friction is not None and alone.log_e >= friction.log_e and _numbers(columns) < _numbers(drives)
    best = max(alone, load, key=lambda its: its.log_e) if simpler else load
    more = load.log_e > tau if friction is None else simpler or load.beats(friction, tau, alpha)
    other = NEARLY * whole.log_e > best.log_e and whole.beats(best, tau, alpha)
    return more and (not other or as_plain_rows(state, columns, every))


def as_plain_rows(state: State, columns: Columns, every: Columns) -> bool:
    """Whether it says nearly as much (NEARLY) as all of the model's parameters where rows count as if their
    noise were white: whitened, slow torque counts little. (2 kg at an AIRBOT's flange, 40 times the noise:
    parameters that followed its fast part said 13 % more; in torque they leave a tenth more than it does.)"""
    halves = halves_of(state, whole(state.plain_metric, state.rows.usable), columns)
    load, most = (cross_evidence(halves, z, acting(columns)).log_e for z in (columns, every))
    return load > 0 and load >= NEARLY * most


def _numbers(columns: Columns) -> int:
    return int(next(iter(columns.values())).shape[1])


def can_be(state: State, own: Metric, term: Term, columns: Columns, sizes: np.ndarray, tau: float) -> bool:
    """Whether physics allows a load, or one that all usable rows hold against it by less than tau nats."""
    names = term.effect.parameters_of(term.place)
    values = {**term.theta, **dict(zip(names, sizes))}
    if term.effect.physical(values, state.model) is not None:
        return False
    m = whole(own, state.rows.usable)
    cross, products, _ = project(m, m.fitted, m.whiten(columns))
    basis = orthonormal(products - cross.T @ cross)
    return 0.5 * term.effect.beyond(values, basis @ basis.T, term.place, state.model) ** 2 < tau


def as_another_zero(
    state: State, halves: tuple[Metric, Metric], term: Term, columns: Columns, evidence: Evidence, tau: float
) -> bool:
    """Of a load to the end of its recording: whether one joint whose position counts from another zero
    there says nearly as much by one number. (Of a UR10e's third joint 5 degrees off in one run a
    body on the third link said 107 nats, that joint's zero 169; of 2 kg on that link they say 355 and 15.)"""
    if term.place.stop is not None:
        return False
    inside = acting(columns)
    zeros = [zero_columns(state, joint, term.place, inside) for joint in range(state.model.robot.n)]
    said = [cross_evidence(halves, z, inside).log_e for z in zeros if z]
    return max(said, default=-np.inf) > NEARLY * evidence.log_e - tau


def zero_columns(state: State, joint: int, place: Place, inside: np.ndarray) -> dict[int, np.ndarray]:
    """{channel: (M, 1)} torque that the model gains per rad (m) of a joint's position, in the rows `inside`
    (M,) of a place's recording; {} where it gains none."""
    parts = []
    for segment, motion in zip(state.segments, state.motions):
        if segment.label != place.recording:
            parts.append(np.zeros((segment.rows, state.rows.channels)))
            continue
        slope = state.model.slopes(motion, joint)[0]
        made = [
            segment.decimate(slope[:, [c]], channel.joint) for c, channel in enumerate(state.model.channels)
        ]
        parts.append(np.hstack(made))
    whole = np.concatenate(parts) * state.rows.scale.T * inside[:, None]
    return {c: whole[:, [c]] for c in range(state.rows.channels) if np.any(whole[:, c])}


def stands_apart(state: State, own: Metric, term: Term, columns: Columns, tau: float) -> bool:
    """Of each load found that acts when this one does: it says something where that one does not act, or that
    one where this one does not. Two loads at one time are one that was not quite what it was told as. (Of a
    push on an AIRBOT that set in over 0.2 s, half a kilogram in the same two seconds was left.)"""
    ours = acting(columns)
    for number, f in enumerate(state.found):
        if f.term is None or not f.term.effect.windowed or f.term.place.recording != term.place.recording:
            continue
        theirs = acting(f.columns)
        if not (ours & theirs).any() or _says(state, own, columns, ~theirs, tau):
            continue
        others = solved(state.but(number))
        m = outside_metric(others, Refined(f.term, f.columns, f.sizes, 0.0), theirs)
        if not _says(others, m, f.columns, ~ours, tau):
            return False
    return True


def _says(state: State, m: Metric, columns: Columns, where: np.ndarray, tau: float) -> bool:
    """Whether a load says more than it would without the rows `where` (M,), if these are as many as a
    load's."""
    inside = acting(columns)
    if (inside & where).sum() * state.rows.hop < SHORTEST_S:
        return False
    halves = halves_of(state, m, columns)
    rest = {c: z * ~where[:, None] for c, z in columns.items()}
    told = cross_evidence(halves, columns, inside).log_e
    return told > tau + max(0.0, cross_evidence(halves, rest, inside).log_e)


def own_friction(
    state: State, halves: tuple[Metric, Metric], inside: np.ndarray
) -> tuple[dict[int, np.ndarray], Evidence | None]:
    """The drives that foretell most where their parameters are the window's own, joint after joint, and what
    they say; none where no drive of its own foretells anything. (All of a rokae's seven at once, of three
    seconds: each half foretold the other worse than with none, and a weight that they stood beside, too.)"""
    left, told = drives_of(state), None
    chosen: tuple[int, ...] = ()
    while left:
        trials = [
            (drive, cross_evidence(halves, own_columns(state, inside, (*chosen, *drive)), inside))
            for drive in left
        ]
        drive, e = max(trials, key=lambda its: its[1].log_e)
        if e.log_e <= (0.0 if told is None else told.log_e):
            break
        told, chosen = e, (*chosen, *drive)
        left.remove(drive)
    return own_columns(state, inside, chosen), told


def _together(columns: Columns, own: Columns) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """(channel, its columns of both) of all channels of either."""
    (rows, p), (_, q) = (next(iter(z.values())).shape for z in (columns, own))
    for c in sorted({*columns, *own}):
        yield c, columns.get(c, np.zeros((rows, p))), own.get(c, np.zeros((rows, q)))


def cross_evidence(
    halves: tuple[Metric, Metric], columns: Mapping[int, np.ndarray], inside: np.ndarray
) -> Evidence:
    """Both predictions together, judged by the blocks `inside`."""
    a, b = (weigh(m, columns, inside=inside) for m in halves)
    return Evidence(
        a.log_e + b.log_e,
        a.gain + b.gain,
        np.concatenate([a.blocks, b.blocks]),
        np.concatenate([a.expected, b.expected]),
        0.5 * (a.sizes + b.sizes),
        a.per_channel + b.per_channel,
        a.rss + b.rss,
        min(a.left, b.left),
        a.free + b.free,
    )


def best_event(
    state: State, effects: Sequence[Effect], layout: Layout, tau: float, alpha: float
) -> Event | None:
    """The load that explains most of any recording, if its blocks predict each other."""
    loads = [effect for effect in effects if effect.windowed]
    if not loads:
        return None
    usable = state.rows.usable
    m = whole(state.metric, usable)
    listed, tried = _likely(m, state, loads, layout, tau)
    limit = tau + float(np.log(max(tried, 1)))
    held: list[Event] = []
    for term, columns in listed:
        term, cut = _moved(m, term, columns, state)
        sizes, gain = fit_sizes(m, cut)
        own = outside_metric(state, Refined(term, cut, sizes, gain), acting(cut))
        sizes, gain = fit_sizes(whole(own, usable), cut)
        if gain < limit or not can_be(state, own, term, cut, sizes, tau):
            continue
        if not stands_apart(state, own, term, cut, limit):
            continue
        halves = halves_of(state, own, cut)
        evidence = cross_evidence(halves, cut, acting(cut))
        told = evidence.log_e > limit and evidence.supported(alpha)
        told = told and not as_another_zero(state, halves, term, cut, evidence, tau)
        if told and is_load(state, halves, cut, limit, alpha):
            held.append(Event(Refined(term, cut, sizes, gain), evidence))
    return _simplest(held, tau) if held else None


def _likely(
    m: Metric, state: State, loads: Sequence[Effect], layout: Layout, tau: float
) -> tuple[list[tuple[Term, dict[int, np.ndarray]]], int]:
    """The loads to judge, each with its best window and its columns, and how many windows were tried.

    The noise at hand is that of a model without the load. A load on a whole run, which the model's own
    parameters answer half, is most of it: in that noise a weight on a Franka's second link came 27th.
    So loads on whole runs are also ranked each by the noise that it leaves."""
    done = {term.key for term in state.terms}
    plain = whole(state.plain_metric, state.rows.usable)
    found: list[tuple[float, Term, dict[int, np.ndarray]]] = []
    all_along: list[tuple[float, Term, dict[int, np.ndarray]]] = []
    tried = 0
    for effect in loads:
        for place in effect.places(layout):
            if place.recording is None or _role(state, place) == "test":
                continue
            term = Term(effect, place, dict(_first(effect, place, state)))
            columns = {} if term.key in done else state.scene.columns(term)
            if not columns:
                continue
            windows, gains = _windows(
                m, columns, state, place, effect.transient, _only_whole(state, place, layout)
            )
            tried += len(windows)
            if not len(windows):
                continue
            k = int(np.argmax(gains))
            if gains[k] > tau:
                found = _best([*found, (float(gains[k]), _window(term, *windows[k]), columns)])
            if (None, None) in windows:
                all_along = _best([*all_along, (quiet(plain, columns), term, columns)])
    listed = {(t.key, t.place.start, t.place.stop): (t, columns) for _, t, columns in (*all_along, *found)}
    return list(listed.values()), tried


def _best(
    ranked: Sequence[tuple[float, Term, dict[int, np.ndarray]]],
) -> list[tuple[float, Term, dict[int, np.ndarray]]]:
    return sorted(ranked, key=lambda item: -item[0])[:TRIED]  # their columns are large


def _simplest(held: Sequence[Event], tau: float) -> Event:
    """Of the loads of the recording that says most which these data cannot tell apart, the one with fewest
    parameters, its window's edges among them; the others stand beside it."""
    most = max(held, key=lambda event: event.evidence.log_e)
    run = most.refined.term.place.recording
    near = most.evidence.log_e - tau
    equal = [e for e in held if e.evidence.log_e > near and e.refined.term.place.recording == run]
    best = min(equal, key=lambda event: (_chosen(event.refined.term), -event.evidence.log_e))
    its = best.refined.term  # with more or fewer of its parameters it is no other explanation
    others = [
        e for e in equal if (e.refined.term.effect, e.refined.term.place.link) != (its.effect, its.place.link)
    ]
    return replace(best, rivals=tuple(others))


def _chosen(term: Term) -> int:
    """Numbers that the data choose: parameters and the edges of its window."""
    return term.free + sum(edge is not None for edge in (term.place.start, term.place.stop))


def _role(state: State, place: Place) -> str:
    return state.rows.roles[state.rows.names.index(str(place.recording))]


def _first(effect: Effect, place: Place, state: State) -> dict[str, float]:
    starts = effect.starts(place, state.motions, [np.zeros(len(m.t)) for m in state.motions], state.model)
    return dict(starts[0]) if starts else {}


def _only_whole(state: State, place: Place, layout: Layout) -> bool:
    """Bodies on inner links are looked for on whole recordings."""
    return place.link is not None and place.link != layout.robot.payload_link("L")


def _window(term: Term, start: float | None, stop: float | None) -> Term:
    return replace(term, place=replace(term.place, start=start, stop=stop))


def _since(state: State, place: Place) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a place's recording and their time since its first sample."""
    number = state.rows.names.index(str(place.recording))
    mine = np.flatnonzero(state.rows.recording == number)
    begun = next(s.begun for s in state.segments if s.label == place.recording)
    return mine, state.rows.t[mine] - begun


def _windows(
    m: Metric, columns: dict[int, np.ndarray], state: State, place: Place, transient: bool, only_whole: bool
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
    alone = sum(r != "test" for r in state.rows.roles) < 2
    if alone or transient:  # on the only recording a load all along is the model's own
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
    """The window's edges where the gain is largest, by rows, one edge after the other."""
    mine, t = _since(state, term.place)
    ends = [term.place.start, term.place.stop]
    here, own = m.only(mine), {c: z[mine] for c, z in columns.items()}  # zero in the other recordings

    def inside(start: float | None, stop: float | None) -> np.ndarray:
        after = t >= (start if start is not None else -np.inf)
        return np.asarray(after & (t < (stop if stop is not None else np.inf)))

    def gain(start: float | None, stop: float | None) -> float:
        kept = inside(start, stop)
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
    rows = np.zeros(len(state.rows.t), bool)
    rows[mine] = inside(ends[0], ends[1])
    return _window(term, ends[0], ends[1]), {c: z * rows[:, None] for c, z in columns.items()}
