"""The loop: what explains most joins the model if rows that chose nothing agree; until nothing does.

Every decision is one comparison (evidence.py) at one rate, tau = ln(BUDGET / alpha): BUDGET hypotheses at
most are held against the judged rows. An effect that passes is named only if a function without a name, of
the very signals that the effect reads, does not say more than tau beyond it (sufficiency); two effects of
the same signals may be sufficient together. What is left in the end is asked for by functions of everything
(leftovers)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ident.diagnosis.candidates import Library, Ranked, screen, white_metric, with_size
from ident.diagnosis.events import Event, best_event, still_holds
from ident.diagnosis.evidence import Evidence, Metric, weigh
from ident.diagnosis.leading import beside_function, leading_metric
from ident.diagnosis.nameless import Flexible, flexible
from ident.diagnosis.refine import Refined, refine
from ident.diagnosis.state import Found, State, converged, settled, solved, with_found, without
from ident.diagnosis.terms import Term
from ident.diagnosis.turning_rows import without_turning
from ident.progress import Progress, silent

BUDGET = 40  # hypotheses that are held against the judged rows; the rate is shared among them
STEPS = 14  # effects at most
LEAST = 0.25  # share of a channel's whitened residual that is worth saying where it does not carry over
WHOLE = 0.25  # by which the size of a change of the model may differ from one
LAW = 4  # free numbers; a size, a shape and a phase are fewer
NEARLY = 0.97  # of what any function says, in nats: of a strong effect this leaves hardly more than its noise
GROUPS = 60  # functions that are asked of a channel: the search that their own evidence has to pay for
SETTLED = 6  # explanations that are settled whole where the first one is not sufficient
FORETOLD = 0.25  # of a residual's power: less than this is new from row to row
TOP_WAVE = 400.0  # 1/rad


@dataclass(frozen=True)
class Equivalent:
    """Another explanation that these data cannot reject, with its log E."""

    term: Term
    log_e: float


@dataclass(frozen=True)
class Step:
    """An effect taken in: what it said then, and what could not be rejected beside it."""

    term: Term
    evidence: Evidence
    equivalent: tuple[Equivalent, ...]
    passed: tuple[Term, ...] = ()  # what else could have been taken in then, on its channels


@dataclass(frozen=True)
class Unnamed:
    """Structure of a channel that no effect explains: its signals, what it says, the nearest effect."""

    channel: int
    variables: tuple[str, ...]
    log_e: float
    gain: float
    share: float  # of the channel's residual variance on the judged rows
    nearest: Equivalent | None = None
    carries_over: bool = True


@dataclass(frozen=True)
class Outcome:
    first: State
    last: State
    steps: tuple[Step, ...]
    unnamed: tuple[Unnamed, ...]
    tau: float
    notes: tuple[str, ...] = field(default=())


def threshold(alpha: float) -> float:
    return float(np.log(BUDGET / alpha))


def trace(
    first: State, library: Library, alpha: float = 0.01, progress: Progress = silent, max_steps: int = STEPS
) -> Outcome:
    """Look for what the model lacks. Pure: rows in, an outcome out."""
    tau = threshold(alpha)
    state = first
    steps: list[Step] = []
    unnamed: list[Unnamed] = []
    closed: set[int] = set()
    while len(steps) < max_steps:
        done, step = 0.15 + 0.75 * (1 - 0.75 ** len(steps)), f"step {len(steps) + 1}"
        progress(f"{step}: what could be missing", done)
        listed = screen(state, library, frozenset(closed))
        progress(f"{step}: weighing it", done)
        weighed = compared(state, listed, tau, alpha)
        progress(f"{step}: loads and contacts", done)
        event = best_event(state, library.events, library.layout, tau, alpha)
        if event is not None and _first(event, weighed):
            r = event.refined
            rivals = tuple(Equivalent(x.refined.term, x.evidence.log_e) for x in event.rivals)
            steps.append(Step(r.term, event.evidence, rivals))
            state = with_found(state, Found(r.term, r.columns, r.sizes))
            continue
        if not weighed.passed:
            break
        best, evidence = simplest(weighed, tau)
        c = main_channel(evidence, best.term, state)
        flex = sufficiency(state, weighed.metric, best.term, c, tau)
        if flex is not None and not sufficient(best.term, evidence, flex, tau):
            settled_in = _settled_in(state, weighed, best, c, tau, alpha)
            if settled_in is not None:
                taken, evidence, state = settled_in
                steps.append(Step(taken.term, evidence, (), _passed(weighed, best, tau)))
                continue
            pair = _pair(state, weighed, best, flex, tau, alpha)
            if pair is None:
                unnamed.append(
                    Unnamed(
                        c,
                        flex.variables,
                        flex.evidence.log_e,
                        flex.evidence.gain,
                        explained_share(state, weighed.metric, c, flex),
                        Equivalent(best.term, evidence.log_e),
                    )
                )
                closed.add(state.model.channels[c].joint)
                state = with_found(state, Found(None, {c: flex.column[:, None]}, np.ones(1), flex.variables))
                continue
        rivals = _rivals(weighed, best, evidence, tau, alpha)
        steps.append(Step(best.term, evidence, rivals, _passed(weighed, best, tau)))
        state = refined_together(with_found(state, Found(best.term, best.columns, best.sizes)))
    progress("what is left", 0.92)
    state, steps = reconsidered(state, steps, tau, alpha)
    state, steps = pruned(state, steps, tau, alpha)
    state, steps, left = leftovers(state, steps, closed, tau, alpha)
    if steps or unnamed or any(u.carries_over for u in left):
        left = [u for u in left if u.carries_over]
    return Outcome(first, state, tuple(steps), (*unnamed, *left), tau)


def _first(event: Event, weighed: Weighed) -> bool:
    """A load that says more than every other explanation is taken before them."""
    return not weighed.passed or event.evidence.log_e > max(e.gain + e.log_e for _, e in weighed.passed)


@dataclass(frozen=True)
class Weighed:
    """The hypotheses of one step in one metric, those that passed best first."""

    metric: Metric
    all: tuple[tuple[Refined, Evidence], ...]
    passed: tuple[tuple[Refined, Evidence], ...]


def compared(state: State, shortlist: Sequence[Ranked], tau: float, alpha: float) -> Weighed:
    """Refine, then weigh all in the noise that the best of them leaves."""
    m = state.metric
    refined = [refine(m, state.scene, r.term) for r in shortlist]
    refined = [r for r in refined if r.columns and r.gain > 1.0]
    if not refined:
        return Weighed(m, (), ())
    m = leading_metric(state, refined)
    refined = [refine(m, state.scene, r.term, turns=2) for r in refined]
    told = [(r, weigh(m, r.columns)) for r in refined]
    plain = white_metric(state)
    passed = [
        (r, e)
        for r, e in told
        if passes(state, r, e, tau, alpha)
        and is_itself(m, r, e, tau, alpha)
        and shifts_all(state, m, r, tau)
        and lowers(plain, r, main_channel(e, r.term, state))
    ]
    return Weighed(m, tuple(told), tuple(sorted(passed, key=lambda item: -item[1].log_e)))


def simplest(weighed: Weighed, tau: float) -> tuple[Refined, Evidence]:
    """Of the explanations of the leading channels that neither kind of rows can tell from the best, the one
    with fewest parameters."""
    lead, most = weighed.passed[0]
    left_out = [
        (r, e)
        for r, e in weighed.passed
        if r.term.effect.replaces and r.term.place.joint == lead.term.place.joint
    ]
    if left_out:  # what the study itself took out of the model is there, and comes before what imitates it
        return left_out[0]
    equal = [
        (r, e) for r, e in weighed.passed if e.log_e > most.log_e - tau and set(r.columns) & set(lead.columns)
    ]
    rows = int((weighed.metric.fitted.mask & weighed.metric.rows.use.any(axis=0)).sum())
    worth = [e.gain - 0.5 * r.term.free * np.log(rows) for r, e in equal]  # each number chosen there is paid
    equal = [its for its, w in zip(equal, worth) if w > max(worth) - tau]
    return min(equal, key=lambda item: (item[0].term.free, not item[0].term.effect.common, -item[1].log_e))


def passes(state: State, r: Refined, e: Evidence, tau: float, alpha: float) -> bool:
    """Enough on both kinds of rows, block by block, and possible."""
    names = r.term.effect.parameters_of(r.term.place)
    values = {**r.term.theta, **dict(zip(names, e.sizes))}
    if r.at_bound or r.term.effect.physical(values, state.model) is not None:
        return False
    if r.term.effect.changes_model and abs(e.sizes[-1] - 1.0) > WHOLE:
        return False  # its last column is the change as it is: all of it or none
    return bool(e.log_e > tau and e.gain > tau and e.left > 1e-5 and e.supported(alpha))


def is_itself(m: Metric, r: Refined, e: Evidence, tau: float, alpha: float) -> bool:
    """Without the parameters that it may leave out it would not be this effect; without the others, it must
    say less."""
    optional = {p.name for p in r.term.effect.linear if p.optional}
    rest = [k for k, name in enumerate(r.term.effect.parameters_of(r.term.place)) if name in optional]
    if not rest or len(rest) == len(r.sizes) or r.term.effect.changes_model:
        return True
    return e.beats(weigh(m, {c: z[:, rest] for c, z in r.columns.items()}), tau, alpha)


def shifts_all(state: State, m: Metric, r: Refined, tau: float) -> bool:
    """A torque that comes at another time does so where the joint keeps its direction, too."""
    if "dtau" not in r.term.effect.needs:
        return True
    return weigh(without_turning(state, m), r.columns).log_e > tau


def lowers(plain: Metric, r: Refined, c: int) -> bool:
    """The error itself falls on the judged rows, on the channel that says most: what a user sees."""
    return bool(weigh(plain, r.columns).per_channel[c] > 0)


def main_channel(evidence: Evidence, term: Term, state: State) -> int:
    """Where it says most, among the channels that it acts in."""
    own = list(term.place.rows(state.model.channels)) or list(range(state.rows.channels))
    return max(own, key=lambda c: evidence.per_channel[c])


def signals_read(term: Term) -> frozenset[str] | None:
    """Names of a flexible function's signals that the effect reads itself; None: not such an effect."""
    effect, place = term.effect, term.place
    if effect.kind != "column" or place.joint is None:
        return None
    j = place.joint + 1
    table = {"q": f"q{j}", "dq": f"dq{j}", "sign_dq": f"dq{j}", "ddq": f"ddq{j}", "tau_link": "tau", "t": "t"}
    table["friction"] = f"dq{j}"
    if place.source is not None:
        k = place.source + 1
        table |= {"q_source": f"q{k}", "dq_source": f"dq{k}", "ddq_source": f"ddq{k}", "sign_sum": f"dq{k}"}
    read = set()
    for name in effect.needs:
        read |= {table[name]} if name in table else {f"q{j}", f"dq{j}", "memory"}
    return frozenset(read)


def sufficient(term: Term, own: Evidence, flex: Flexible | None, tau: float) -> bool:
    """A law of up to three numbers that says as much as any function of its signals, within the limit, is a
    law; one with more numbers takes up smooth functions as they come, and has to say as much, or more.
    What an effect's columns are wrong by (filters, samples, the turn-over's shape) grows with the effect:
    NEARLY."""
    if flex is None:
        return True
    asked = flex.evidence.log_e * (NEARLY if term.free <= LAW else 1.0)
    return own.log_e > asked + _margin(term.free, tau)


def _margin(numbers: int, tau: float) -> float:
    return tau * float(np.clip(numbers - LAW, -1, 1))


def sufficiency(state: State, m: Metric, term: Term, c: int, tau: float) -> Flexible | None:
    """The best function without a name of the signals that the effect reads."""
    read = signals_read(term)
    if read is None or term.effect.replaces:  # what the study itself left out is there, whatever else is
        return None
    return ask(state, m, c, tau, read)


def ask(
    state: State, m: Metric, c: int, wanted: float, only: frozenset[str] | None = None
) -> Flexible | None:
    joint = state.model.channels[c].joint
    load = [state.model.total(motion)[:, c] for motion in state.motions]
    return flexible(m, c, joint, state.segments, load, TOP_WAVE, wanted, only)


def heard(state: State, c: int, tau: float) -> tuple[Flexible | None, Metric]:
    """The best function of everything, and the noise that it was heard in: the one at hand, or, where most of
    the residual can be foretold from its own past and would count as noise, what is left beside the best
    function of plain rows."""
    found = ask(state, state.metric, c, tau), state.metric
    counted = state.rows.use[c] & state.rows.fitted
    power = np.mean(state.residual[c, counted] ** 2) if counted.any() else 0.0
    if state.whiteners[c].sigma ** 2 > FORETOLD * power:
        return found
    plain = ask(state, white_metric(state), c, tau)
    if plain is None:
        return found
    m = beside_function(state, c, plain.column, plain.variables)
    again = ask(state, m, c, tau)
    here = -np.inf if found[0] is None else found[0].evidence.log_e
    if again is None or (here > tau and here > again.evidence.log_e):
        return found
    if again.evidence.log_e < tau and "t" in again.variables:  # a course of time is what slow noise is, too
        return found
    return again, m


def _settled_in(
    state: State, weighed: Weighed, best: Refined, c: int, tau: float, alpha: float
) -> tuple[Refined, Evidence, State] | None:
    """Of the first explanations of the leading channels the one that predicts the judged rows best among
    those that are sufficient once dry friction's turn-over, from all its range, and all shapes were taken
    again beside it: what it was compared with before may have taken its place in part."""
    out: tuple[float, Refined, Evidence, State] | None = None
    likely = [(r, e) for r, e in weighed.all if e.log_e > tau and set(r.columns) & set(best.columns)]
    for r, evidence in sorted(likely, key=lambda its: -its[1].log_e)[:SETTLED]:
        joint = state.model.channels[c].joint
        afresh = replace(state, turns={j: turn for j, turn in state.turns.items() if j != joint})
        trial = refined_together(with_found(afresh, Found(r.term, r.columns, r.sizes)))
        number = _place_of(trial, r.term)
        if number is None:
            continue
        f, others = trial.found[number], trial.but(number)
        assert f.term is not None
        whole = Refined(f.term, f.columns, f.sizes, 0.0)
        m = leading_metric(others, [whole])
        own, flex = weigh(m, f.columns), sufficiency(others, m, f.term, c, tau)
        if not passes(others, whole, own, tau, alpha):
            continue
        error = float(np.mean(trial.residual[c, trial.rows.judged & trial.rows.use[c]] ** 2))
        if sufficient(f.term, own, flex, tau) and (out is None or error < out[0]):
            out = error, r, evidence, trial
    return None if out is None else out[1:]


def _place_of(state: State, term: Term) -> int | None:
    """Where a hypothesis stands among what was found; None: it acts nowhere any more."""
    places = (k for k, f in enumerate(state.found) if f.term is not None and f.term.key == term.key)
    return next(places, None)


def _pair(
    state: State, weighed: Weighed, best: Refined, flex: Flexible, tau: float, alpha: float
) -> Refined | None:
    """Another effect on the channel beside which the best one is sufficient after all."""
    for other, _ in weighed.all:
        if other.term.key == best.term.key or not set(other.columns) & set(best.columns):
            continue
        both = {
            c: np.hstack([r.columns[c] if c in r.columns else np.zeros((len(state.rows.t), len(r.sizes)))
                          for r in (best, other)])
            for c in {*best.columns, *other.columns}
        }  # fmt: skip
        together = weigh(weighed.metric, both)
        asked = flex.evidence.log_e + _margin(max(best.term.free, other.term.free), tau)
        if together.log_e > asked and together.supported(alpha):
            return other
    return None


def _rivals(
    weighed: Weighed, best: Refined, evidence: Evidence, tau: float, alpha: float
) -> tuple[Equivalent, ...]:
    """What passed on its channels and is not beaten by it, without those that only add parameters to it and
    gain nothing by them."""
    own = max((e.log_e for r, e in weighed.passed if r.term.key == best.term.key), default=0.0)
    return tuple(
        Equivalent(r.term, e.log_e)
        for r, e in weighed.passed
        if set(r.columns) & set(best.columns)
        and not evidence.beats(e, tau, alpha)
        and r.term.key != best.term.key
        and (r.term.free <= best.term.free or e.log_e > own)
    )


def explained_share(state: State, m: Metric, c: int, flex: Flexible) -> float:
    """Share of what the model leaves of the channel's torque (N m, judged rows, the model's parameters
    free) that the function explains as it was learned."""
    design, _ = state.design
    on = state.rows.judged & state.rows.use[c]
    X = design[c][1][on]
    both = np.column_stack([state.rows.Y[c, on], flex.column[on]])
    rho, z = (both - X @ np.linalg.lstsq(X, both, rcond=1e-9)[0]).T
    return float(np.clip(1 - np.sum((rho - z) ** 2) / max(float(rho @ rho), 1e-300), 0.0, 1.0))


def refined_together(state: State) -> State:
    """Shapes of all effects found, each beside the others, then the whole settled."""
    for number, f in enumerate(state.found):
        if f.term is None or not (f.term.effect.nonlinear or f.term.size is not None):
            continue
        others = state.but(number)
        best = refine(others.metric, others.scene, f.term, turns=3)
        if not best.columns:
            continue
        term = best.term if best.term.size is None else with_size(best.term, best.sizes)
        found = list(state.found)
        found[number] = Found(term, best.columns, best.sizes)
        state = solved(replace(state, found=tuple(found)))
    return settled(converged(state), 1)


def _passed(weighed: Weighed, best: Refined, tau: float) -> tuple[Term, ...]:
    """What else could stand in its place; of what acts on the model's own torque all that says something, as
    the model beside it has been settled without it."""
    passed = {r.term.key for r, _ in weighed.passed}
    return tuple(
        r.term
        for r, e in weighed.all
        if set(r.columns) & set(best.columns)
        and (r.term.key in passed or (r.term.size is not None and e.log_e > tau))
    )


def reconsidered(state: State, steps: list[Step], tau: float, alpha: float) -> tuple[State, list[Step]]:
    """Each effect weighed again against what could have stood in its place, beside all that was found since:
    what was missing then can have made one explanation look better than it is, or a simpler one too poor."""
    for number, f in enumerate(state.found):
        at = next((k for k, s in enumerate(steps) if f.term is not None and s.term.key == f.term.key), None)
        if f.term is None or at is None or not any(t.key != f.term.key for t in steps[at].passed):
            continue
        others = state.but(number)
        trials = [f.term if t.key == f.term.key else t for t in steps[at].passed]
        weighed = compared(others, [Ranked(t, 0.0) for t in trials], tau, alpha)
        if not weighed.passed:
            continue
        best, evidence = simplest(weighed, tau)
        flex = sufficiency(others, weighed.metric, best.term, main_channel(evidence, best.term, others), tau)
        if best.term.key == f.term.key or not sufficient(best.term, evidence, flex, tau):
            continue
        rivals = _rivals(weighed, best, evidence, tau, alpha)
        steps[at] = Step(best.term, evidence, rivals, steps[at].passed)
        found = list(state.found)
        found[number] = Found(best.term, best.columns, best.sizes)
        state = refined_together(replace(state, found=tuple(found)))
    return state, steps


def swapped(outcome: Outcome, at: int, term: Term) -> Outcome:
    """Another explanation in the place of a step's, settled beside the rest."""
    state, step = outcome.last, outcome.steps[at]
    number = _place_of(state, step.term)
    others = state if number is None else state.but(number)
    columns = others.scene.columns(term)
    if number is None or not columns:
        return outcome
    state = refined_together(with_found(others, Found(term, columns, np.array(term.size or [1.0]))))
    if _place_of(state, term) is None:
        return outcome
    steps = (*outcome.steps[:at], replace(step, term=term), *outcome.steps[at + 1 :])
    return replace(outcome, last=state, steps=steps)


def pruned(state: State, steps: list[Step], tau: float, alpha: float) -> tuple[State, list[Step]]:
    """Leave out, one after the other, what the judged rows do not ask for beside the rest."""
    while True:
        weak: tuple[float, int] | None = None
        for number, f in enumerate(state.found):
            if f.term is None:
                continue
            others = state.but(number)
            if f.term.place.recording is not None:
                if not still_holds(others, f, tau, alpha):
                    weak = (-np.inf, number)
                continue
            e = weigh(others.metric, f.columns)
            if e.log_e < tau and (weak is None or e.log_e < weak[0]):
                weak = (e.log_e, number)
        if weak is None:
            return state, steps
        gone = state.found[weak[1]].term
        assert gone is not None
        steps = [s for s in steps if s.term.key != gone.key]
        state = without(state, weak[1])


def leftovers(
    state: State, steps: list[Step], closed: set[int], tau: float, alpha: float
) -> tuple[State, list[Step], list[Unnamed]]:
    """What functions of everything still explain, channel by channel; names beside it must hold alone."""
    out: list[Unnamed] = []
    for c in range(state.rows.channels):
        if not (state.rows.use[c] & state.rows.judged).any():
            continue
        flex, m = heard(state, c, tau)
        if flex is None:
            continue
        if flex.evidence.log_e < tau or not flex.evidence.supported(alpha):
            wide = 1 - np.exp(-2 * flex.evidence.gain / m.fitted.free[c])
            if wide > LEAST and flex.prior_evidence > tau + np.log(GROUPS * state.rows.channels):
                told = flex.evidence  # its share is that of the rows that it was learned on, whitened
                out.append(Unnamed(c, flex.variables, told.log_e, told.gain, wide, None, carries_over=False))
            continue
        share = explained_share(state, m, c, flex)
        column = Found(None, {c: flex.column[:, None]}, np.ones(1), flex.variables)
        for number, f in reversed(list(enumerate(state.found))):
            if f.term is None or f.term.place.joint is None or c not in f.columns:
                continue
            others = state.but(number)
            learned = ask(others, others.metric, c, tau)
            if learned is None:
                continue
            beside = solved(others.plus(replace(column, columns={c: learned.column[:, None]})))
            if weigh(beside.metric, f.columns).log_e < tau:
                steps = [s for s in steps if s.term.key != f.term.key]
                state = without(state, number)
        out.append(Unnamed(c, flex.variables, flex.evidence.log_e, flex.evidence.gain, share))
        closed.add(state.model.channels[c].joint)
    return state, steps, out
