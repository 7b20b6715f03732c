"""When a load begins and ends, in the noise that it leaves: of all windows that overlap, by rows, and between
them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.leading import outside_metric
from ident.diagnosis.evidence.metric import Metric, acting, whole
from ident.diagnosis.evidence.refine import Refined, fit_sizes
from ident.diagnosis.evidence.state import State
from ident.diagnosis.loads.edge_gains import gains_with_edge
from ident.diagnosis.loads.is_a_load import SHORTEST_S
from ident.diagnosis.loads.windows import STEP_S, part_alone, since, windows_of, with_window
from ident.diagnosis.rows.terms import Term
from modelgen.effects.place import Place

EDGE = 2.0  # rows by which an edge is moved at first
TURNS = 4  # of a window and the noise outside it, until its edges stay


def in_noise_outside(state: State, r: Refined, limit: float) -> tuple[Metric, Refined]:
    """The noise outside a load's window, and the load in it, the window where all rows then want it: the
    noise of a model without the load is for the most part the load. As it was, where it says less than a
    limit there. (Of 3 N beside another contact the noise of both put an edge 0.2 s too early, where a block
    spoke against it.)"""
    wide: dict[int, np.ndarray] = {}
    for _ in range(TURNS):
        own = outside_metric(state, r, acting(r.columns))
        m = whole(own, state.rows.usable)
        r = Refined(r.term, r.columns, *fit_sizes(m, r.columns))
        if r.gain < limit or not r.term.place.comes_and_goes:
            return own, r
        wide = wide or state.scene.columns(with_window(r.term, None, None))  # its window alone is moved
        term, columns = moved(m, _anew(m, r, wide, state), wide, state)
        if _as_before(r.term.place, term.place, state.rows.hop):
            break
        r = Refined(term, columns, *fit_sizes(m, columns))
    return own, edged(m, state, r)


def _anew(m: Metric, r: Refined, wide: dict[int, np.ndarray], state: State) -> Term:
    """The load in the window that says most of those that overlap its own, wherever their edges are. (The
    last three seconds of a contact of six were told, as long as its noise was that of the first three.)"""
    place = r.term.place
    windows, gains = windows_of(m, wide, state, place, True, False)
    begun, ended = _ends(place.start, place.stop)
    for k in np.argsort(-gains):
        start, stop = _ends(*windows[k])
        if gains[k] > r.gain and start < ended and begun < stop:
            return with_window(r.term, *windows[k])
    return r.term


def _ends(start: float | None, stop: float | None) -> tuple[float, float]:
    return (-np.inf if start is None else start), (np.inf if stop is None else stop)


def _as_before(one: Place, other: Place, hop: float) -> bool:
    """Whether two windows have the same edges, but for a row. (An end of the recording is another edge than
    one that is found in it: the window with which a load that was told to the end ends before was left.)"""
    pairs = ((one.start, other.start), (one.stop, other.stop))
    return all(a == b or (a is not None and b is not None and abs(a - b) < hop) for a, b in pairs)


def moved(
    m: Metric, term: Term, columns: dict[int, np.ndarray], state: State
) -> tuple[Term, dict[int, np.ndarray]]:
    """The window's edges where the gain is largest, by rows, one edge after the other; none where that is an
    end of the recording. (Edges before the first row gain as much as it: a body on a whole run of an AIRBOT
    was told as a force from -8.5 s on.)"""
    mine, t = since(state, term.place)
    part = part_alone(state, term.effect)
    ends = list(_ends(term.place.start, term.place.stop))
    here, own = m.only(mine), {c: z[mine] for c, z in columns.items()}  # zero in the other recordings
    for which in (0, 1) * 2:
        if np.isinf(ends[which]):
            continue
        begins, other = which == 0, ends[1 - which]
        near = ends[which] + np.arange(-2 * STEP_S, 2.01 * STEP_S, max(state.rows.hop, 0.05))
        wide = other - near if begins else near - (0.0 if np.isinf(other) else other)
        near = near[wide > 0.5 * SHORTEST_S]
        if part:
            near = near[[not _inside(t, *((e, other) if begins else (other, e))).all() for e in near]]
        if len(near):
            gains = gains_with_edge(here, own, t, near, other, begins)
            ends[which] = float(near[int(np.argmax(gains))])
    start = None if ends[0] <= t.min() else ends[0]
    stop = None if ends[1] > t.max() else ends[1]
    rows = np.zeros(len(state.rows.t), bool)
    rows[mine] = _inside(t, *_ends(start, stop))
    return with_window(term, start, stop), {c: z * rows[:, None] for c, z in columns.items()}


def _inside(t: np.ndarray, start: float, stop: float) -> np.ndarray:
    return np.asarray((t >= start) & (t < stop))


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
    its = replace(term, place=place)
    columns = state.scene.columns(its)
    return Refined(its, columns, *(fit_sizes(m, columns) if columns else (np.zeros(0), -np.inf)))
