"""The loop: rank what could be missing, add the best that held-out data confirm, fit again, until nothing is left."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

from ident.diagnosis.candidates import (
    SPECIFIC_FIRST_WAVE,
    Library,
    Ranked,
    all_terms,
    build_library,
    ripple_peaks,
    screen,
    screen_columns,
    screen_dynamic,
)
from ident.diagnosis.events import block_folds, load_terms, refine_window, window_terms
from ident.diagnosis.generic_rival import GenericLibrary, Rival, best_rival, build_generic
from ident.diagnosis.scoring import Bank, Columns, Folds, Score, System, make_bank, make_system
from ident.diagnosis.state import Found, State, refine, refit, stack_columns
from ident.diagnosis.terms import Context, Term, columns
from modelgen.effects import catalogue

MAX_TERMS = 14
SHORTLIST = 14
FIRST_GAIN = 14.0  # log-likelihood on the fitted rows: Bonferroni over some thousand candidates at 1 %
HELD_GAIN = 4.0
SMALLEST_SHARE = 0.02  # of the strongest finding's gain
SHARE_BESIDE_UNEXPLAINED = 0.25  # of the gain of what has no name: its echoes are smaller
EVENT_GAIN = 25.0  # thousands of windows are searched
EVENT_HELD_GAIN = 10.0
NAMED_TRAVEL = 8e-4  # rad; a shorter presliding is how any sign turns over
EQUAL = 0.03  # candidates this close are equal: fewer parameters win


@dataclass(frozen=True)
class Candidate:
    """A refined candidate with its exact score; `total` is comparable between kinds."""

    term: Term
    columns: Columns
    score: Score
    total: float
    event: bool = False

    @property
    def parameters(self) -> int:
        return len(self.term.terms) + len(self.term.effect.nonlinear) + (2 if self.term.window else 0)


@dataclass(frozen=True)
class Step:
    """One turn of the loop for the report."""

    accepted: Term | None
    ranking: tuple[Candidate, ...]
    before: State
    after: State
    gain: float
    held_out: float
    event: bool = False


@dataclass(frozen=True)
class Outcome:
    steps: tuple[Step, ...]
    first: State
    last: State
    unexplained: tuple[Rival, ...]


@dataclass
class Search:
    """What stays the same during the loop."""

    terms: list[Term]
    library: Library
    generic: GenericLibrary
    event_folds: Folds
    progress: Callable[[str, float | None], None]
    event_bank: Bank | None = None

    def event_system(self, state: State) -> System:
        """The state's columns over all runs that may be looked at, in alternating blocks."""
        if self.event_bank is None:
            self.event_bank = make_bank(state.bank.base, state.bank.keep, self.event_folds)
        own = [f.columns for f in state.found if not f.lent]
        return make_system(self.event_bank, stack_columns(state.bank, own), state.system.y)


def run_loop(
    first: State,
    without: Sequence[str],
    progress: Callable[[str, float | None], None],
    max_terms: int = MAX_TERMS,
) -> Outcome:
    context = first.context
    rows = context.rows
    terms = all_terms(context.view, without)
    progress("candidate columns", 0.1)
    roles = np.array([r.role for r in rows.runs])[rows.run]
    search = Search(
        terms,
        build_library(terms, context),
        build_generic(rows.fine, rows.low_pass),
        block_folds(rows.run, rows.t, roles != "test"),
        progress,
    )
    state = first
    steps: list[Step] = []
    unexplained: list[Rival] = []
    blocked: set[int] = set()
    strongest = 0.0
    least_share = SMALLEST_SHARE
    while len(state.terms) < max_terms:
        progress(f"step {len(steps) + 1}: ranking", 0.15 + 0.8 * (1 - 0.8 ** len(steps)))
        ranking = rank(state, search, blocked)
        step = None
        for candidate in ranking[:3]:
            step = try_candidate(state, candidate, ranking, least_share * strongest)
            if step is not None:
                break
        if step is None:
            break
        rival, replaced = challenge(state, step, search, blocked)
        if replaced and rival is not None:
            unexplained.append(rival)
            blocked.add(rival.channel)
            nuisance = Found(None, {rival.channel: rival.columns}, rival.score.coefficients, "unexplained")
            strongest, least_share = max(strongest, rival.score.identify), SHARE_BESIDE_UNEXPLAINED
            state = refit(state, [*state.found, nuisance])
            continue
        strongest = max(strongest, step.gain)
        steps.append(step)
        state = step.after
    progress("what is left", 0.95)
    state, steps = prune(state, steps)
    for rival in leftovers(state, search, blocked, strongest):
        unexplained.append(rival)
    return Outcome(tuple(steps), first, state, tuple(unexplained))


def rank(state: State, search: Search, blocked: set[int]) -> list[Candidate]:
    """Refined candidates, best first."""
    system, context = state.system, state.context
    done = {t.key for t in state.terms}
    ranked = screen(search.library, system)
    ranked += screen_dynamic(search.terms, context, system, done)
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
            or r.gain < 0.5 * HELD_GAIN
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
        near = [c for c in candidates if c.total > (1 - EQUAL) * top]
        near.sort(key=lambda c: (c.parameters, -c.total))
        candidates = near + [c for c in candidates if c.total <= (1 - EQUAL) * top]
    return candidates


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
    score = system.score(cols, share=np.ones(len(system.y)))
    if effect.name == "backlash" and "drop" not in term.terms:  # the travel through the gap is the gap
        for _ in range(3):
            term = term.at(travel=float(np.clip(score.coefficients[0], 2e-5, 0.05)))
            cols = columns(term, context)
            score = system.score(cols, share=np.ones(len(system.y)))
    signs = {q.name: q.sign for q in effect.linear}
    if any(signs.get(n) == "positive" and a < 0 for n, a in zip(term.terms, score.coefficients)):
        return None
    return Candidate(term, cols, score, score.total)


def _bracket(name: str, p, value: float, context: Context, term: Term) -> tuple[float, float]:
    grid = [g for g in p.grid]
    if name == "torque_ripple":
        span = 0.7 * np.pi / max(float(np.ptp(context.rows.fine.q[:, term.joint])), 0.3)
        return max(p.low, value - span), min(p.high, value + span)
    if name == "hysteresis":  # shorter travels are the sign's own (friction_sign)
        grid = [NAMED_TRAVEL, *(g for g in grid if g > NAMED_TRAVEL)]
        value = max(value, NAMED_TRAVEL)
    below = [g for g in grid if g < value]
    above = [g for g in grid if g > value]
    return (below[-1] if below else (NAMED_TRAVEL if name == "hysteresis" else p.low)), (above[0] if above else p.high)


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
    ranked = [r for r in ranked if r.positive and r.gain > HELD_GAIN]
    ranked.sort(key=lambda r: -r.gain)
    out = []
    for r in ranked[:6]:
        term = refine_window(r.term, context, system)
        cols = columns(term, context)
        score = system.score(cols, share=np.ones(len(system.y)))
        if term.effect.name == "payload_change" and score.coefficients[0] <= 0:
            continue
        out.append(Candidate(term, cols, score, 0.5 * score.total, True))
    return out


def try_candidate(state: State, candidate: Candidate, ranking, least: float) -> Step | None:
    """Fit with the candidate; keep it when both kinds of rows confirm it with effective sample counts."""
    found = [*state.found, Found(candidate.term, candidate.columns, candidate.score.coefficients)]
    after = refine(refit(state, found))
    gain, held = gains(state.system, after.system)
    if candidate.event:
        share = float(np.mean(after.system.share))
        gain, held = share * candidate.score.identify, share * candidate.score.held_out
    first, second = (EVENT_GAIN, EVENT_HELD_GAIN) if candidate.event else (FIRST_GAIN, HELD_GAIN)
    if gain < max(first, least) or held < second:
        return None
    if held < 0.15 * gain * (
        1.0 if candidate.event or not state.folds.by_validation else _balance(state.system)
    ):
        return None
    if at_bound(after.found[-1].term):
        return None
    return Step(after.found[-1].term, tuple(ranking[:12]), state, after, gain, held, candidate.event)


def _balance(system: System) -> float:
    """Held-out rows per fitted row."""
    tests = [s for _, test in system.folds.held_out for s in test]
    fitted = system.count[list(system.folds.identify)].sum()
    return float(min(1.0, system.count[tests].sum() / max(fitted, 1)))


def gains(before: System, after: System) -> tuple[float, float]:
    """Log-likelihood gained on identify and on held-out rows, effective samples of the residual that is left."""
    N = after.count[list(after.folds.identify)].sum(axis=0)
    tests = [s for _, test in after.folds.held_out for s in test]
    N_held = after.count[tests].sum(axis=0)
    gain = np.sum(after.share * N / 2 * np.log(before.rss / after.rss))
    held = np.sum(after.share * N_held / 2 * np.log(before.rss_held / after.rss_held))
    return float(gain), float(held)


def at_bound(term: Term | None) -> bool:
    """A nonlinear parameter at the end of its range: the shape is not this effect's."""
    if term is None:
        return False
    theta = term.effect.complete(term.theta)
    if term.effect.name == "hysteresis" and theta["width"] < 1.2 * NAMED_TRAVEL:
        return True
    for p in term.effect.nonlinear:
        span = p.high - p.low
        if min(theta[p.name] - p.low, p.high - theta[p.name]) < 1e-3 * min(span, abs(theta[p.name]) + p.low):
            return True
    return False


def main_channel(step: Step) -> int:
    """Channel whose held-out error falls most."""
    before, after = step.before.system, step.after.system
    return int(np.argmax(np.log(before.rss / after.rss)))


def challenge(state: State, step: Step, search: Search, blocked: set[int]) -> tuple[Rival | None, bool]:
    """Does a nameless explanation beat the accepted term clearly on its main channel?"""
    c = step.accepted.channels[0] if len(step.accepted.channels) == 1 else main_channel(step)  # type: ignore[union-attr]
    if c in blocked:
        return None, False
    rival = best_rival(search.generic, state.system, c)
    if rival is None:
        return None, False
    own = step.after.system
    share = own.share
    N = own.count[list(own.folds.identify)].sum(axis=0)
    tests = [s for _, test in own.folds.held_out for s in test]
    N_held = own.count[tests].sum(axis=0)
    gain = np.sum(share * N / 2 * np.log(state.system.rss / rival.score.rss))
    held = np.sum(share * N_held / 2 * np.log(state.system.rss_held / rival.score.rss_held))
    if gain + held < 1.1 * (step.gain + step.held_out) + 10:
        return rival, False
    return rival, True


def prune(state: State, steps: list[Step]) -> tuple[State, list[Step]]:
    """Take out found terms that the others made superfluous."""
    while len(state.terms) > 1:
        worst, smallest, without = None, np.inf, None
        for i, f in enumerate(state.found):
            if f.term is None:
                continue
            reduced = refit(state, [g for k, g in enumerate(state.found) if k != i], turns=1)
            gain, held = gains(reduced.system, state.system)
            if f.term.run is not None:
                continue
            if min(gain, held) < smallest:
                worst, smallest, without = i, min(gain, held), reduced
        if worst is None or smallest > HELD_GAIN or without is None:
            break
        key = state.found[worst].term.key  # type: ignore[union-attr]
        state = without
        steps = [s for s in steps if s.accepted is None or s.accepted.key != key]
    return state, steps


def leftovers(state: State, search: Search, blocked: set[int], strongest: float) -> list[Rival]:
    """Channels with structure left that is confirmed on held-out rows."""
    out = []
    for c in range(len(state.system.y)):
        if c in blocked:
            continue
        rival = best_rival(search.generic, state.system, c)
        if rival is None:
            continue
        share = state.system.share[c]
        gain, held = share * rival.score.identify, share * rival.score.held_out
        if gain > max(2 * FIRST_GAIN, 0.05 * strongest) and held > max(2 * HELD_GAIN, 0.2 * gain):
            out.append(rival)
    return out
