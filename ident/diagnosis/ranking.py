"""What could be missing, best first: a linear screen of every place, then the best few refined and scored."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

from ident.diagnosis.candidates import (
    OWN_TERMS,
    SPECIFIC_FIRST_WAVE,
    Library,
    Ranked,
    ripple_peaks,
    screen,
    screen_columns,
    screen_dynamic,
)
from ident.diagnosis.events import load_terms, refine_window, window_terms
from ident.diagnosis.generic_rival import GenericLibrary
from ident.diagnosis.nuisance import score_beside_nuisance, with_free_signs
from ident.diagnosis.plausibility import NAMED_TRAVEL, physical
from ident.diagnosis.scoring import (
    Bank,
    Columns,
    Folds,
    Score,
    System,
    effective_share,
    make_bank,
    make_system,
)
from ident.diagnosis.settling import resettle_fully
from ident.diagnosis.state import Found, State, stack_columns
from ident.diagnosis.terms import Context, Term, columns
from modelgen.effects import catalogue

SHORTLIST = 16
LEAST_GAIN = 4.0  # log-likelihood on the linear screen
EVENT_LEFT = 0.01  # share of a load that the model must leave
COMPARABLE = 0.6  # share of the first one's gain
SLOW = 0.6  # of the largest rate
EQUAL = 0.03  # candidates this close are equal: fewer parameters win


@dataclass(frozen=True)
class Candidate:
    """A refined candidate with its exact score; `total` is comparable between kinds."""

    term: Term
    columns: Columns
    score: Score
    total: float
    event: bool = False
    effective: tuple[float, float] = (0.0, 0.0)  # of an event: gains with effective sample counts

    @property
    def parameters(self) -> int:
        return len(self.term.terms) + len(self.term.free) + (2 if self.term.window else 0)


@dataclass
class Search:
    """What stays the same during the loop."""

    terms: list[Term]
    library: Library
    generic: GenericLibrary
    event_folds: Folds
    bank: Bank  # that the stored products belong to
    event_bank: Bank | None = None

    def resettled(self, state: State) -> State:
        """The state with its friction signs chosen again; products with the old ones are forgotten."""
        settled = resettle_fully(state)
        if settled.bank is not self.bank:
            self.bank = settled.bank
            self.library._products.clear()
            self.generic.products.clear()
            self.event_bank = None
        return settled

    def event_system(self, state: State) -> System:
        """The state's columns over all runs that may be looked at, in alternating blocks."""
        if self.event_bank is None:
            self.event_bank = make_bank(state.bank.base, state.bank.keep, self.event_folds)
        own = [f.columns for f in state.found if not f.lent]
        return make_system(self.event_bank, stack_columns(state.bank, own), state.system.y)


def rank(state: State, search: Search, blocked: set[int]) -> list[Candidate]:
    """Refined candidates, best first."""
    system, context = state.system, state.context
    done = {t.key for t in state.terms}
    ranked = screen(search.library, system)
    ranked += [with_free_signs(r, state) for r in screen_dynamic(search.terms, context, system, done)]
    ripple = catalogue()["torque_ripple"]
    for c in range(len(context.view.channels)):
        if context.view.channels[c].startswith("tau_l") and len(context.view.channels) > context.view.n:
            continue
        for k in ripple_peaks(ripple, context, system, c):
            term = Term(ripple, context.view.joint_of[c], (c,), ripple.linear_names, {"wavenumber": k})
            ranked.append(screen_columns(term, columns(term, context), system))
    difference = context.view.channels[0].startswith("tau_d")
    events: list[Candidate] = []
    if not difference:
        for term in load_terms(context):
            if term.run is None:
                ranked.append(screen_columns(term, columns(term, context), system))
        events = rank_events(state, search)
    best: dict[tuple, Ranked] = {}
    for r in ranked:
        if (
            not r.positive
            or r.gain < LEAST_GAIN
            or (r.term.key in done and r.term.effect.name != "torque_ripple")
        ):
            continue
        if len(r.term.channels) == 1 and r.term.channels[0] in blocked:
            continue
        key = (*r.term.key, r.term.terms)
        if r.term.effect.name == "torque_ripple":  # one slow and one fast wave per place
            key = (*key, r.term.theta["wavenumber"] > SPECIFIC_FIRST_WAVE)
        if key not in best or r.gain > best[key].gain:
            best[key] = r
    short = sorted(best.values(), key=lambda r: -r.gain)[:SHORTLIST]
    out = [_refined(r.term, state) for r in short]
    halve = 1.0 if state.folds.by_validation else 0.5
    candidates = [replace(c, total=halve * c.total) for c in out if c is not None] + events
    candidates = [c for c in candidates if c.score.identify > 0]
    candidates.sort(key=lambda c: -c.total)
    if candidates:
        top = candidates[0].total
        near = [c for c in candidates if c.total >= top - EQUAL * abs(top)]
        near.sort(key=lambda c: (c.parameters, -c.total))
        near = _by_extrapolation(near, candidates, state)
        candidates = near + [c for c in candidates if not any(c is n for n in near)]
        candidates.sort(
            key=lambda c: c.term.effect.name not in OWN_TERMS
        )  # what a study left out comes first
    return candidates


def _by_extrapolation(near: list[Candidate], every: list[Candidate], state: State) -> list[Candidate]:
    """Friction that flattens at speed: a cubic that falls, or a power law? What predicts fast rows from slow
    ones comes first; within the rates of the recordings the two are nearly the same curve."""
    laws = ("nonlinear_viscous_friction", "power_law_friction")
    first = near[0]
    if first.term.effect.name not in laws:
        return near
    pair = [c for c in every if c.term.effect.name in laws and c.term.channels == first.term.channels]
    cubic = next((c for c in pair if c.term.effect.name == laws[0]), None)
    power = next((c for c in pair if c.term.effect.name == laws[1]), None)
    if cubic is None or power is None or cubic.score.coefficients[0] >= 0:
        return near
    if min(cubic.total, power.total) < COMPARABLE * first.total:
        return near
    best = min((cubic, power), key=lambda c: _fast_error(c, state))
    return [best, *(c for c in near if c is not best)]


def _fast_error(c: Candidate, state: State) -> float:
    """Sum of squares on the fast rows of the candidate's channel, everything fitted on the slow ones."""
    rows, channel = state.context.rows, c.term.channels[0]
    rate = np.abs(rows.fine.dq[rows.filter.centres, c.term.joint])
    fast = rate > SLOW * rate[state.folds.sets >= 0].max()
    folds = Folds(np.where(state.folds.sets >= 0, fast.astype(int), -1), (0,), (((0,), (1,)),), False)
    bank = make_bank(state.bank.base, state.bank.keep, folds)
    extra = stack_columns(state.bank, [f.columns for f in state.found])
    return float(make_system(bank, extra, rows.y).score(c.columns).rss_held[channel])


def _refined(term: Term, state: State) -> Candidate | None:
    """Nonlinear parameters improved one after the other on the linear screen, then the exact score."""
    system, context = state.system, state.context
    effect = term.effect
    for p in effect.nonlinear:
        value = term.theta.get(p.name, p.grid[0])
        lo, hi = _bracket(effect.name, p, value, context, term)
        log = p.low > 0 and effect.name != "torque_ripple"

        def loss(x: float, term=term, p=p, log=log) -> float:
            placed = term.at(**{p.name: float(np.exp(x)) if log else float(x)})
            ranked = screen_columns(placed, columns(placed, context), system)
            return -ranked.gain

        a, b = (np.log(lo), np.log(hi)) if log else (lo, hi)
        found = scipy.optimize.minimize_scalar(loss, bounds=(a, b), method="bounded", options={"maxiter": 9})
        best = float(np.exp(found.x)) if log else float(found.x)
        if found.fun < loss(np.log(value) if log else value):
            term = term.at(**{p.name: best})
    cols = columns(term, context)
    score = score_beside_nuisance(term, cols, state)
    if effect.name == "backlash" and "drop" not in term.terms:  # the travel through the gap is the gap
        for _ in range(3):
            term = term.at(travel=float(np.clip(score.coefficients[0], 2e-5, 0.05)))
            cols = columns(term, context)
            score = system.score(cols, share=np.ones(len(system.y)))
    if not physical(Found(term, cols, score.coefficients)):
        return None
    return Candidate(term, cols, score, score.total)


def _bracket(name: str, p, value: float, context: Context, term: Term) -> tuple[float, float]:
    grid = list(p.grid)
    if name == "torque_ripple":
        span = 0.7 * np.pi / max(float(np.ptp(context.rows.fine.q[:, term.joint])), 0.3)
        return max(p.low, value - span), min(p.high, value + span)
    if name == "hysteresis":  # shorter travels are the sign's own (friction_sign)
        grid = [NAMED_TRAVEL, *(g for g in grid if g > NAMED_TRAVEL)]
        value = max(value, NAMED_TRAVEL)
    below = [g for g in grid if g < value]
    above = [g for g in grid if g > value]
    return (below[-1] if below else (NAMED_TRAVEL if name == "hysteresis" else p.low)), (
        above[0] if above else p.high
    )


def rank_events(state: State, search: Search) -> list[Candidate]:
    """Payloads and contacts, judged on alternating blocks of all runs (see `events`)."""
    context = state.context
    system = search.event_system(state)
    usable = [i for i, r in enumerate(context.rows.runs) if r.role != "test"]
    taken = {(t.effect.name, t.run) for t in state.terms}
    ranked = [
        screen_columns(t, columns(t, context), system)
        for t in load_terms(context, tilt=False)
        if (t.effect.name, t.run) not in taken
    ]
    ranked += [
        r for r in window_terms(context, system, usable) if (r.term.effect.name, r.term.run) not in taken
    ]
    ranked = [r for r in ranked if r.positive and r.gain > 2 * LEAST_GAIN]
    ranked.sort(key=lambda r: -r.gain)
    out = []
    for r in ranked[:6]:
        term = refine_window(r.term, context, system)
        cols = columns(term, context)
        score = system.score(cols, share=np.ones(len(system.y)))
        if term.effect.name == "payload_change" and score.coefficients[0] <= 0:
            continue
        if score.collinear < EVENT_LEFT:
            continue
        total = system.count.sum(axis=0) / 2
        share = np.array([_event_share(system, cols, score, c) for c in range(len(total))])
        gain = float(np.sum(share * total * np.log(system.rss / score.rss)))
        held = float(np.sum(share * total * np.log(system.rss_held / score.rss_held)))
        out.append(Candidate(term, cols, score, 0.5 * score.total, True, (gain, held)))
    return out


def _event_share(system: System, cols: Columns, score: Score, c: int) -> float:
    """Effective samples per row of a channel once the event is taken off its residual (approximately)."""
    after = system.residual[c] - cols[c] @ score.coefficients if c in cols else system.residual[c]
    return effective_share(after, system.folds, system.keep[c])
