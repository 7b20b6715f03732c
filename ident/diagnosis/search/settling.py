"""An explanation settled whole: its shapes, dry friction's turn-over and all that was found, taken again
beside it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice, zip_longest

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, over, weigh
from ident.diagnosis.evidence.leading import leading_metric
from ident.diagnosis.evidence.metric import metric, whole
from ident.diagnosis.evidence.refine import Refined, refine
from ident.diagnosis.evidence.settled import as_late_rows, converged, settled, with_found, without
from ident.diagnosis.evidence.state import Found, State, recolumned, shown, solved
from ident.diagnosis.evidence.sufficiency import short_of
from ident.diagnosis.evidence.turned import turned
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Ranking, with_size
from ident.diagnosis.search.parameters_apart import spoken, spoken_given
from ident.diagnosis.search.weighing import Equivalent, Weighed, holds, is_physical, main_channel
from modelgen.effects.effect import Effect
from modelgen.effects.place import Place

ROUNDS, STAYS = 5, 0.03  # of a size: what it may still move by
LATE_S = (0.005, 0.01, 0.02, 0.03, 0.04, 0.06)  # to begin with; a turn-over imitates none that is early
LATE_ROUNDS, LATEST = 3, 3  # of a delay and the turn-over beside it; beginnings that are settled whole
SETTLED = 6  # explanations that are settled whole where none holds as it is


@dataclass(frozen=True)
class Settled:
    """A hypothesis in the state that was settled with it, and what it says; tried: what else may make the
    torque of its place as late; rivals: what explains as much."""

    refined: Refined
    evidence: Evidence
    state: State
    tried: tuple[Term, ...] = ()
    rivals: tuple[Equivalent, ...] = ()


def refined_together(state: State, white: bool = False) -> State:
    """Shapes of all effects found, each beside the others, then the whole settled; again until sizes stay
    where an effect acts on the model's own torque, or shapes answer each other. white: as if noise were, not
    in the one at hand. (Of two Stribeck frictions of 22 and 24 N m on a joint, after once 35 and 11 were
    left, and functions of the rate said more.)"""
    for _ in range(ROUNDS):
        before = _sizes(state)
        state = _refined_once(state, white)
        after = _sizes(state)
        if set(before) != set(after) or all(abs(after[k] - before[k]) < STAYS * abs(after[k]) for k in after):
            break
    return state


def _sizes(state: State) -> dict[tuple, float]:
    """Of the effects found whose columns are made at a size, or which share a torque with another one whose
    shape is sought, too."""
    shaped = [f for f in state.found if f.term is not None and f.term.effect.nonlinear]
    beside = [f for f in shaped if any(g is not f and set(g.columns) & set(f.columns) for g in shaped)]
    sizes = {f.term.key: float(np.linalg.norm(f.sizes)) for f in beside if f.term is not None}
    return sizes | {f.term.key: f.term.size[0] for f in state.found if f.term is not None and f.term.size}


def _refined_once(state: State, white: bool) -> State:
    for number, f in enumerate(state.found):
        if f.term is None or not (f.term.effect.nonlinear or f.term.size is not None):
            continue
        others = state.but(number)
        m = others.metric
        if white:
            m = metric(state.rows, *others.design, state.plain_whiteners, slow=False)
        m = m if shown(state.rows, f.columns) else whole(m, state.rows.usable)
        best = refine(m, others.scene, f.term, turns=3)
        if not best.columns:
            continue
        several = best.term.size is not None and len(best.term.size) > 1
        term = with_size(best.term, best.sizes) if several else best.term
        state = solved(state.swapped(number, Found(term, best.columns, best.sizes)))
    return settled(converged(state), 1)


def on_late_rows(state: State) -> State:
    """The state on the rows of torques as late as they were found (`as_late_rows`), settled there."""
    for _ in range(ROUNDS):
        late = as_late_rows(state)
        if late is state:
            break
        state = refined_together(late)
    return state


def place_of(state: State, term: Term) -> int | None:
    """Where a hypothesis stands among what was found; None: it acts nowhere any more."""
    places = (k for k, f in enumerate(state.found) if f.term is not None and f.term.key == term.key)
    return next(places, None)


def without_terms(state: State, terms: Iterable[Term]) -> State:
    """The state without those of the terms that are in it, settled again."""
    for term in terms:
        at = place_of(state, term)
        state = state if at is None else without(state, at)
    return state


def _afresh(state: State, r: Refined, joint: int | None) -> State:
    """A hypothesis settled in, dry friction's turn-over of the joint (None: of all) from all its range. What
    acts on the model's own torque is settled as if noise were white first: that model answered for it, and
    the noise at hand is what it left. (Of a gear of 124 N m/rad a tenth of its compliance was left that began
    at the right one.)"""
    turns = {j: turn for j, turn in state.turns.items() if joint is not None and j != joint}
    begun = with_found(replace(state, turns=turns), Found(r.term, r.columns, r.sizes))
    if r.term.size is not None:
        begun = refined_together(begun, white=True)
    return refined_together(begun)


def in_time(
    state: State, places: Iterable[tuple[Effect, Place]], near: Place, tau: float, alpha: float
) -> Settled | None:
    """The torque of all joints, or of one place, recorded late or smoothed: of the beginnings that fit best,
    each with dry friction's turn-over taken anew beside it, the one that says most, and all that were tried.
    A turn-over that was found without a delay has taken its place: of 15 ms of all six joints of a UR10e half
    a millisecond was left to it, and two lags were told; and what it leaves has several summits: of 43 ms of
    an AIRBOT's, late by 17 of its own, the beginning at 40 ended at 20, and nothing was told. Where none
    holds by the judged rows alone these are asked given the fitted ones: in two seconds of a Barrett 20 ms
    were 11 nats in too few blocks, and are 58."""
    tried = []
    for effect, place in places:
        here = place.joint in (None, near.joint) and place.side in (None, near.side)
        if effect.shifts_time and here:
            tried += [_late(state, Term(effect, place, {}, (size,))) for size in LATE_S]
    before = whitened_squares(state, state, state.rows.fitted)
    begun: dict[tuple, list[tuple[Term, State]]] = {}
    for left, term, trial in sorted(tried, key=lambda its: its[0]):
        if before - left > tau:
            begun.setdefault(term.key, []).append((term, trial))
    in_turn = chain.from_iterable(zip_longest(*begun.values()))  # a whole delay keeps no joint's own off
    asked = [(its[0], refined_together(its[1])) for its in islice(filter(None, in_turn), LATEST)]
    for given in (False, True):
        best = _most(_holding(state, trial, term, tau, alpha, given) for term, trial in asked)
        if best is not None:
            return replace(best, tried=tuple({term.key: term for term, _ in asked}.values()))
    return None


def late_as_a_whole(
    state: State, places: Iterable[tuple[Effect, Place]], tau: float, alpha: float
) -> Settled | None:
    """`in_time` for all torques at once, where the fitted rows speak for it. No joint alone says so, and what
    a delay leaves of a short run its parameters take up: 20 ms of a Franka were an error of 1.8 % where it
    was fitted and of 6.6 elsewhere."""
    whole = [(effect, place) for effect, place in places if effect.shifts_time and place.joint is None]
    known = {term.key for term in state.terms}
    asked = [its for its in whole if Term(*its, {}).key not in known]
    metrics = (state.metric, state.plain_metric)
    if not any(refine(m, state.scene, Term(*its, {})).gain > tau for its in asked for m in metrics):
        return None
    return in_time(state, asked, Place(), tau, alpha)


def late_joints(state: State, ranking: Ranking, rounds: Iterable[Weighed], tau: float) -> list[Place]:
    """Places of one joint whose torque the fitted rows ask to shift in time, in the noise at hand, or the
    judged ones where it was weighed; what asks most first. (In white rows a clean twin's third joint asked,
    and two minutes of it took a half longer. Of an LWR4+'s fifth torque, 18 ms late, presliding had taken all
    but 3 nats of the fitted rows; the judged ones asked for 57, and 2.7 % were left for 0.7.)"""
    late = {(t.place.joint, t.place.side) for t in state.terms if t.effect.shifts_time}
    gains: dict[tuple, tuple[float, Place]] = {}
    asking = [(r.gain, r.term) for r in ranking[0].values()]
    asking += [(e.log_e, r.term) for weighed in rounds for r, e in weighed.all]
    for gain, term in ((gain, term) for gain, term in asking if term.effect.shifts_time and gain > tau):
        place = term.place
        where = (place.joint, place.side)
        if place.joint is None or late & {where, (None, None), (None, place.side)}:
            continue
        gains[where] = max(gains.get(where, (0.0, place)), (gain, place), key=lambda its: its[0])
    return [place for _, place in sorted(gains.values(), key=lambda its: -its[0])]


def late_alone(
    state: State, places: Iterable[tuple[Effect, Place]], where: Sequence[Place], tau: float, alpha: float
) -> Settled | None:
    """`in_time` for each of these joints alone; of those that hold the one that says most. Beside a turn-over
    that was settled without it none says so: 15 ms of a TX40's fourth joint were 15 nats, and are 90."""
    alone = [(effect, place) for effect, place in places if place.joint is not None]
    return _most(in_time(state, alone, near, tau, alpha) for near in where)


def _most(held: Iterable[Settled | None]) -> Settled | None:
    """Of what holds that which says most."""
    return max((h for h in held if h is not None), key=lambda h: h.evidence.log_e, default=None)


def as_late(term: Term, places: Iterable[tuple[Effect, Place]], known: Iterable[Term]) -> tuple[Term, ...]:
    """What else, beside the `known`, makes the torque of the same place as late: beside a turn-over that was
    settled with one of them the others look worse than they are. (Of 7 ms of delay at three times the noise a
    lag was told, and nothing beside it.)"""
    if not term.effect.shifts_time:
        return ()
    where, keys = (term.place.joint, term.place.side), {t.key for t in known}
    alike = (its for its in places if its[0].shifts_time and (its[1].joint, its[1].side) == where)
    trials = (Term(effect, place, {}, term.size) for effect, place in alike)
    return tuple(trial for trial in trials if trial.key not in keys)


def _late(state: State, term: Term) -> tuple[float, Term, State]:
    """Whitened sum of squares on the fitted rows with a torque that is late by so much, the term, and the
    state with it, the turn-over of the dry friction in that torque followed from where it was."""
    trial = state.plus(Found(term, state.scene.columns(term), np.array(term.size)))
    for _ in range(LATE_ROUNDS):
        trial = turned(solved(recolumned(solved(trial))), joint=term.place.joint)
    trial = solved(trial)
    return whitened_squares(state, trial, trial.rows.fitted), term, trial


def whitened_squares(noise: State, trial: State, on: np.ndarray) -> float:
    """Sum of squares of a state's residual on some rows (M,), in the noise of another."""
    parts = zip(noise.whiteners, trial.residual, trial.rows.use)
    return sum(float(np.sum((w @ r)[use & on] ** 2)) for w, r, use in parts)


def _holding(
    state: State, trial: State, term: Term, tau: float, alpha: float, given: bool = False
) -> Settled | None:
    """A hypothesis in the state that was settled with it, what it says against the model that did its best
    without it; None where it does not hold. That blocks agree is asked of the effect alone: against the model
    as it was they also hold what each turn-over wins and loses there. given: the judged rows are asked given
    the fitted ones."""
    number = place_of(trial, term)
    if number is None:
        return None
    f, others = trial.found[number], trial.but(number)
    whole = Refined(f.term or term, f.columns, f.sizes, 0.0)
    m = leading_metric(others, [whole])
    own = spoken_given(m, f, weigh(m, f.columns), tau) if given else spoken(m, f, tau)
    if own is None or not holds(others, m, whole, own, tau, alpha):
        return None
    told = over(metric(state.rows, *state.design, m.whiteners), m, own)  # the model as it was did its best
    if not (told.log_e > tau and is_physical(state, m, whole, told, tau)):
        return None
    c = main_channel(own, whole.term, others)
    if short_of(others, m, whole, own, c, tau) is not None:
        return None
    return Settled(whole, told, trial)


def settled_in(
    state: State, weighed: Weighed, best: Refined, c: int, tau: float, alpha: float
) -> Settled | None:
    """Of the first explanations of the leading channels the one that predicts the judged rows best among
    those that are sufficient once dry friction's turn-over, from all its range, and all shapes were taken
    again beside it: what it was compared with before may have taken its place in part. What the study itself
    left out is asked wherever the fitted rows ask for it, whose turn-over may have taken it whole. (Of a
    rokae's viscous friction at three times the noise 6 nats were left.)"""
    out: tuple[float, Settled] | None = None
    here = [(r, e) for r, e in weighed.all if set(r.columns) & set(best.columns)]
    likely = [(r, e) for r, e in here if e.log_e > tau or (r.term.effect.replaces and e.gain > tau)]
    for r, _ in sorted(likely, key=lambda its: (not its[0].term.effect.replaces, -its[1].log_e))[:SETTLED]:
        trial = _afresh(state, r, state.model.channels[c].joint)
        held = _holding(state, trial, r.term, tau, alpha)
        if held is None:
            continue
        error = float(np.mean(trial.residual[c, trial.rows.judged & trial.rows.use[c]] ** 2))
        if out is None or error < out[0]:
            out = error, replace(held, refined=r)
    return None if out is None else out[1]


def _begun(state: State, r: Refined, ranking: Ranking) -> Iterator[Refined]:
    """What is settled: as it is, and what acts on the model's own torque as white rows have it, too."""
    yield r
    if r.term.size is not None and r.term.key in ranking[1]:
        yield refine(state.plain_metric, state.scene, ranking[1][r.term.key].term)


def settled_anew(
    state: State, weighed: Weighed, ranking: Ranking, tau: float, alpha: float
) -> Settled | None:
    """Of what the fitted rows ask for most and the judged ones speak against, one that holds once it was
    settled in: a model that settled without it has something else in its place, and beside that it must fail
    elsewhere. (Of 1.9 mrad of backlash a turn-over of dry friction was left: 1,500 nats on the fitted rows,
    -40 on the judged ones, and 750 with the turn-over taken anew.) With what would explain as much in its
    place, on its channels or on others. A factor of the model is settled whatever the judged rows say: what
    is left beside it is not what was left without it. What shifts the torque in time has its own way,
    `in_time`."""
    upset = [
        (r, e)
        for r, e in weighed.all
        if e.gain > tau and (e.log_e < -tau or r.term.factor != 1.0)
        if not r.at_bound and not r.term.effect.shifts_time
    ]
    held = []
    for r, e in sorted(upset, key=lambda its: -its[1].gain)[:SETTLED]:
        joint = state.model.channels[main_channel(e, r.term, state)].joint
        trials = (
            _holding(state, _afresh(state, its, joint), r.term, tau, alpha)
            for its in _begun(state, r, ranking)
        )
        first = next((trial for trial in trials if trial is not None), None)
        held += [] if first is None else [first]
    if not held:
        return None
    best, *others = held
    same = (
        Equivalent(o.refined.term, o.evidence.log_e)
        for o in others
        if abs(o.evidence.log_e - best.evidence.log_e) < tau
        and weigh(best.state.metric, o.refined.columns).log_e < tau
    )
    return replace(best, rivals=tuple(same))
