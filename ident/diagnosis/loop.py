"""The loop: rank what could be missing, add the best that held-out data confirm, fit again, until nothing
is left."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

from ident.diagnosis.candidates import (
    OWN_TERMS,
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
from ident.diagnosis.noise_floor import white_floor
from ident.diagnosis.rotor_split import settle_rotor
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
from ident.diagnosis.state import (
    Found,
    State,
    objective,
    refine,
    refit,
    resettle,
    sharpen,
    stack_columns,
)
from ident.diagnosis.terms import Context, Term, columns
from modelgen.effects import catalogue

MAX_TERMS = 14
MOST_SETTLINGS = 10  # a delay and the turn-over of the signs take turns until both stand still
SHORTLIST = 16
TRIES = 5
FIRST_GAIN = 25.0  # log-likelihood on fitted rows; Bonferroni asks 14, impostors of real friction reach 20
HELD_GAIN = 8.0
OWN_GAIN, OWN_HELD_GAIN = 14.0, 4.0  # of a term that the study itself left out: it has no impostors
SMALLEST_SHARE = 0.02  # of the strongest finding's gain
SMALLEST_EVENT_DROP = 0.05  # of a channel's error over all runs
SMALLEST_DROP = 0.04  # of a channel's held-out error: below it, impostors outnumber effects
SHARE_BESIDE_UNEXPLAINED = 0.25  # of the gain of what has no name: its echoes are smaller
EVENT_GAIN = 40.0  # thousands of windows are searched
EVENT_HELD_GAIN = 18.0
EVENT_LEFT = 0.01  # share of a load that the model must leave
LEFT_GAIN = 40.0  # of a nameless explanation of what is left
LEFT_HELD_GAIN = 15.0
LEFT_SHARE = 0.10  # of the residual's variance, on both kinds of rows; coloured noise gives some per cent
ABOVE_FLOOR = 8.0  # times the white floor (it misses slow noise): structure, where held-out rows agree
FAR_ABOVE_FLOOR = 15.0  # structure, whatever it depends on
PLAIN_GAIN, PLAIN_SHARE = (
    400.0,
    0.5,
)  # structure on the fitted rows alone: held-out motion may differ too much
FEWEST_WAVES = 1.5  # of a ripple within the joint's range; fewer are a spring or a bend, not a ripple
NARROWEST_STRIBECK = 0.018  # of the largest rate
NAMED_TRAVEL = 8e-4  # rad; a shorter presliding is how any sign turns over
LATE = ("time_delay",)
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
    raw_total: float = 0.0  # the candidate's own gains with every row counted


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
        first.bank,
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
        for candidate in ranking[:TRIES]:
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
            state = search.resettled(refit(state, [*state.found, nuisance]))
            continue
        strongest = max(strongest, step.gain)
        steps.append(step)
        state = search.resettled(step.after)
    progress("what is left", 0.95)
    state, steps = prune(state, steps, least_share * strongest)
    for rival, gain in leftovers(state, search, blocked, strongest):
        unexplained.append(rival)
        impostors = {
            s.accepted.key
            for s in steps
            if s.accepted is not None and s.accepted.effect.name not in OWN_TERMS
            if rival.channel in s.accepted.channels and s.accepted.effect.joints != "robot"
            if s.gain + s.held_out < gain
        }
        if impostors:  # they took a small part of something that has no name
            steps = [s for s in steps if s.accepted is None or s.accepted.key not in impostors]
            state = refit(state, [f for f in state.found if f.term is None or f.term.key not in impostors])
    return Outcome(tuple(steps), first, state, tuple(unexplained))


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
        near = [c for c in candidates if c.total >= top - EQUAL * abs(top)]
        near.sort(key=lambda c: (c.parameters, -c.total))
        near = _no_falling_cubic(near, candidates)
        candidates = near + [c for c in candidates if not any(c is n for n in near)]
        candidates.sort(
            key=lambda c: c.term.effect.name not in OWN_TERMS
        )  # what a study left out comes first
    return candidates


def _no_falling_cubic(near: list[Candidate], every: list[Candidate]) -> list[Candidate]:
    """A power law, if nearly as good, before a cubic that makes friction fall at speed."""
    first = near[0]
    if first.term.effect.name != "nonlinear_viscous_friction" or first.score.coefficients[0] >= 0:
        return near
    for c in every:
        same = c.term.effect.name == "power_law_friction" and c.term.channels == first.term.channels
        if same and c.total > 0.95 * first.total:
            return [c, *(other for other in near if other is not c)]
    return near


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
    signs = {q.name: q.sign for q in effect.linear}
    if any(signs.get(n) == "positive" and a < 0 for n, a in zip(term.terms, score.coefficients)):
        return None
    return Candidate(term, cols, score, score.total)


def resettle_fully(state: State) -> State:
    """The state with its friction signs chosen again until they and what was found stand still.

    Where a torque comes late, a second attempt starts from friction that turns over at once: the delay and
    the turn-over swallow each other's part, and taking turns alone ends half-way.
    """
    settled = _taking_turns(state)
    view = state.context.view
    late = {view.joint_of[c] for t in state.terms if t.effect.name in LATE for c in t.channels}
    if late:
        other = _taking_turns(sharpen(state, sorted(late)))
        settled = min((settled, other), key=objective)
    return refine(settled) if settled.bank is not state.bank else settled


def _taking_turns(state: State) -> State:
    settled = state
    delayed = any(t.effect.name in LATE for t in state.terms)
    for _ in range(MOST_SETTLINGS):
        current = refit(settled, list(settled.found)) if delayed else settled
        settled = resettle(current)
        if settled is current:
            break
    return settled


def sign_columns(term: Term, state: State) -> Columns:
    """What a sharper turn-over of friction would change in the term's channels, a column per joint.

    A torque that comes late lets friction turn over late, and the turn-over chosen without the delay has
    already swallowed much of it: a delay is judged beside signs that are free to turn over at once.
    """
    context = state.context
    fine, view = context.rows.fine, context.view
    joints = sorted({view.joint_of[c] for c in term.channels})
    sharp = np.tanh(fine.dq[:, joints] / fine.sign_width[joints]) - fine.sign[:, joints]
    change = context.rows.low_pass @ sharp
    out: Columns = {}
    for c in term.channels:
        out[c] = np.zeros_like(change)
        k = joints.index(view.joint_of[c])
        out[c][:, k] = change[:, k]
    used = [k for k in range(len(joints)) if np.abs(change[:, k]).max() > 1e-6]
    return {c: z[:, used] for c, z in out.items()} if used else {}


def with_free_signs(ranked: Ranked, state: State) -> Ranked:
    """The linear screen of a late torque beside free friction signs; other terms as they are."""
    term = ranked.term
    if term.effect.name not in LATE:
        return ranked
    system, signs = state.system, sign_columns(term, state)
    if not signs:
        return ranked
    cols = columns(term, state.context)
    both = screen_columns(term, {c: np.hstack([cols[c], signs[c]]) for c in cols}, system)
    return replace(ranked, gain=max(ranked.gain, both.gain - screen_columns(term, signs, system).gain))


def score_beside_nuisance(term: Term, cols: Columns, state: State) -> Score:
    """The exact score; of a late torque beside free friction signs, less what these gain alone; of a tilted
    base less what the moments gain that gravity did not show before."""
    system, equal = state.system, np.ones(len(state.system.y))
    plain = system.score(cols, share=equal)
    moments = beyond_terms(term, cols)
    if moments:
        alone = system.score(moments, share=equal)
        return replace(
            plain, identify=plain.identify - alone.identify, held_out=plain.held_out - alone.held_out
        )
    signs = sign_columns(term, state) if term.effect.name in LATE else {}
    if not signs:
        return plain
    both = system.score({c: np.hstack([cols[c], signs[c]]) for c in cols}, share=equal)
    alone = system.score(signs, share=equal)
    free = replace(
        both,
        identify=both.identify - alone.identify,
        held_out=both.held_out - alone.held_out,
        coefficients=both.coefficients[: len(plain.coefficients)],
    )
    return free if free.total > plain.total else plain


def beyond_terms(term: Term, cols: Columns) -> Columns:
    """Columns that go with a term and are not of its own parameters."""
    p = len(term.terms)
    return {c: z[:, p:] for c, z in cols.items() if z.shape[1] > p and np.any(z[:, p:])}


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
    ranked = [r for r in ranked if r.positive and r.gain > HELD_GAIN]
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


def try_candidate(state: State, candidate: Candidate, ranking, least: float) -> Step | None:
    """Fit with the candidate; keep it when both kinds of rows confirm it with effective sample counts."""
    found = [*state.found, Found(candidate.term, candidate.columns, candidate.score.coefficients)]
    after = settle_rotor(refine(refit(state, found)))
    if candidate.term.effect.name in LATE:
        after = resettle_fully(after)
    gain, held = gains(state.system, after.system)
    moments = beyond_terms(candidate.term, candidate.columns)
    if moments:
        alone = state.system.score(moments)
        gain, held = gain - alone.identify, held - alone.held_out
    if candidate.event:
        gain, held = candidate.effective
        before_all, after_all = (s.rss + s.rss_held for s in (state.system, after.system))
        if largest_drop(before_all, after_all)[0] < SMALLEST_EVENT_DROP:
            return None
    elif (
        candidate.term.effect.name not in OWN_TERMS
        and held_out_drop(state.system, after.system) < SMALLEST_DROP
    ):
        return None
    first, second = (EVENT_GAIN, EVENT_HELD_GAIN) if candidate.event else required(candidate.term)
    if gain < max(first, least) or held < second:
        return None
    if held < 0.15 * gain * (
        1.0 if candidate.event or not state.folds.by_validation else _balance(state.system)
    ):
        return None
    if (
        not physical(after.found[-1])
        or at_bound(after.found[-1].term)
        or is_turn_over(after.found[-1].term, after.context)
        or is_bend(after.found[-1].term, after.context)
        or leaves_no_friction(after.found[-1].term, after.context)
    ):
        return None
    return Step(
        after.found[-1].term,
        tuple(ranking[:12]),
        state,
        after,
        gain,
        held,
        candidate.event,
        candidate.score.total,
    )


def required(term: Term) -> tuple[float, float]:
    """Gains on fitted and on held-out rows that keep a term."""
    return (OWN_GAIN, OWN_HELD_GAIN) if term.effect.name in OWN_TERMS else (FIRST_GAIN, HELD_GAIN)


def _balance(system: System) -> float:
    """Held-out rows per fitted row."""
    tests = [s for _, test in system.folds.held_out for s in test]
    fitted = system.count[list(system.folds.identify)].sum()
    return float(min(1.0, system.count[tests].sum() / max(fitted, 1)))


def gains(before: System, after: System) -> tuple[float, float]:
    """Log-likelihood gained on identify and on held-out rows, effective samples of the residual that is
    left."""
    N = after.count[list(after.folds.identify)].sum(axis=0)
    tests = [s for _, test in after.folds.held_out for s in test]
    N_held = after.count[tests].sum(axis=0)
    gain = np.sum(after.share * N / 2 * np.log(before.rss / after.rss))
    held = np.sum(after.share * N_held / 2 * np.log(before.rss_held / after.rss_held))
    return float(gain), float(held)


def largest_drop(before: np.ndarray, after: np.ndarray) -> tuple[float, int]:
    """Share by which the error of the channel that gains most falls, from sums of squares; that channel."""
    ratio = after / np.maximum(before, 1e-30)
    c = int(np.argmin(ratio))
    return float(1 - np.sqrt(ratio[c])), c


def held_out_drop(before: System, after: System) -> float:
    """The largest drop on held-out rows; 1 where nothing is held out."""
    return largest_drop(before.rss_held, after.rss_held)[0] if before.rss_held.any() else 1.0


def at_bound(term: Term | None) -> bool:
    """A nonlinear parameter at the end of its range: the shape is not this effect's."""
    if term is None:
        return False
    theta = term.effect.complete(term.theta)
    if term.effect.name == "hysteresis" and theta["width"] < 1.2 * NAMED_TRAVEL:
        return True
    for p in term.effect.nonlinear:
        if p.name == "travel":
            continue
        span = p.high - p.low
        if min(theta[p.name] - p.low, p.high - theta[p.name]) < 1e-3 * min(span, abs(theta[p.name]) + p.low):
            return True
    return False


def is_turn_over(term: Term | None, context: Context) -> bool:
    """A Stribeck curve so narrow that it only describes how the sign turns over."""
    if term is None or term.effect.name != "stribeck_friction" or term.joint is None:
        return False
    top = float(np.abs(context.rows.fine.dq[:, term.joint]).max())
    return term.theta["vs"] < NARROWEST_STRIBECK * top


def is_bend(term: Term | None, context: Context) -> bool:
    """A ripple so slow that the joint's range holds hardly a wave of it."""
    if term is None or term.effect.name != "torque_ripple" or term.joint is None:
        return False
    waves = term.theta["wavenumber"] * float(np.ptp(context.rows.fine.q[:, term.joint])) / (2 * np.pi)
    return waves < FEWEST_WAVES


def leaves_no_friction(term: Term | None, context: Context) -> bool:
    """A warm-up that ends at a negative viscous friction: a slow change of another kind."""
    if term is None or term.effect.name != "thermal_friction" or term.joint is None:
        return False
    number = context.view.number(("Fvm", "Fvl"), term.joint)
    return number is not None and float(context.chi[number]) < 0.0


def main_channel(step: Step) -> int:
    """Channel whose held-out error falls most."""
    before, after = step.before.system, step.after.system
    return int(np.argmax(np.log(before.rss / after.rss)))


def challenge(state: State, step: Step, search: Search, blocked: set[int]) -> tuple[Rival | None, bool]:
    """Does a nameless explanation beat the accepted term clearly on its main channel?"""
    term = step.accepted
    assert term is not None
    if term.effect.name in OWN_TERMS:  # the study itself left it out, so it is there, whatever else is
        return None, False
    c = term.channels[0] if len(term.channels) == 1 else main_channel(step)
    if c in blocked:
        return None, False
    rival = best_rival(search.generic, state.system, c, state.context)
    if rival is None:
        return None, False
    if rival.score.total < 1.05 * step.raw_total:
        return rival, False
    nuisance = Found(None, {c: rival.columns}, rival.score.coefficients, "unexplained")
    gain, held = gains(state.system, refit(state, [*state.found, nuisance], turns=1).system)
    if gain + held < 1.1 * (step.gain + step.held_out) + 10:
        return rival, False
    return rival, True


def prune(state: State, steps: list[Step], least: float) -> tuple[State, list[Step]]:
    """Take out found terms that became superfluous, or whose sign physics forbids in the last fit."""
    while state.terms:
        worst: tuple[float, int, State] | None = None
        for i, f in enumerate(state.found):
            if f.term is None or (f.lent and len(state.terms) == 1):
                continue
            reduced = refit(state, [g for k, g in enumerate(state.found) if k != i], turns=1)
            gain, held = gains(reduced.system, state.system)
            first, second = required(f.term)
            value = min(gain / max(first, least), held / second)
            if f.term.run is not None:
                value = 2.0
            if not physical(f):
                value = -np.inf
            if worst is None or value < worst[0]:
                worst = (value, i, reduced)
        if worst is None or worst[0] > 1.0 or (len(state.terms) == 1 and worst[0] > -np.inf):
            break
        key = state.found[worst[1]].term.key  # type: ignore[union-attr]
        state = worst[2]
        steps = [s for s in steps if s.accepted is None or s.accepted.key != key]
    return state, steps


def physical(f: Found) -> bool:
    """Coefficients have the signs that physics allows."""
    if f.term is None:
        return True
    signs = {q.name: q.sign for q in f.term.effect.linear}
    return not any(signs.get(n) == "positive" and a < 0 for n, a in zip(f.term.terms, f.coefficients))


def leftovers(state: State, search: Search, blocked: set[int], strongest: float) -> list[tuple[Rival, float]]:
    """Channels with structure left and its gain: a nameless explanation confirmed on held-out rows, or far
    above the noise floor."""
    rows = state.context.rows
    floor = white_floor(rows, state.context.torque)
    rms = np.sqrt(
        np.sum((state.system.residual * rows.keep) ** 2, axis=1) / np.maximum(rows.keep.sum(axis=1), 1)
    )
    out = []
    for c in range(len(state.system.y)):
        if c in blocked:
            continue
        rival = best_rival(search.generic, state.system, c, state.context, size=4)
        if rival is None:
            continue
        above = floor[c] > 1e-3 * rms[c] and rms[c] > ABOVE_FLOOR * floor[c]
        far_above = above and rms[c] > FAR_ABOVE_FLOOR * floor[c]
        if rival.score.identify < LEFT_GAIN and not above:
            continue
        nuisance = Found(None, {c: rival.columns}, rival.score.coefficients, "unexplained")
        after = refit(state, [*state.found, nuisance], turns=1).system
        gain, held = gains(state.system, after)
        share = 1 - max(after.rss[c] / state.system.rss[c], after.rss_held[c] / state.system.rss_held[c])
        enough = gain > max(LEFT_GAIN, 0.03 * strongest) and held > max(LEFT_HELD_GAIN, 0.15 * gain)
        plain = gain > PLAIN_GAIN and after.rss[c] < (1 - PLAIN_SHARE) * state.system.rss[c]
        confirmed = plain or (enough and share > LEFT_SHARE)
        if confirmed or far_above or (above and held > LEFT_HELD_GAIN):
            percent = rival.share_percent if confirmed else 100 * (1 - (floor[c] / rms[c]) ** 2)
            out.append((replace(rival, share_percent=float(percent)), gain + held if confirmed else 0.0))
    return out
