"""The loop: what explains most joins the model if rows that chose nothing agree; until nothing does.

Every decision is one comparison (evidence.py) at one rate, tau = ln(BUDGET / alpha): BUDGET hypotheses at
most are held against the judged rows. An effect that passes is named only if a function without a name, of
the very signals that the effect reads, does not say more than tau beyond it (sufficiency); two effects of
the same signals may be sufficient together. What is left in the end is asked for by functions of everything
(leftovers)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ident.diagnosis.candidates import Library, Ranked, elsewhere, ranked, short_list
from ident.diagnosis.events import Event, best_event, still_holds
from ident.diagnosis.evidence import Evidence, Metric, weigh
from ident.diagnosis.halves import by_halves
from ident.diagnosis.in_common import by_common, shown_by_fitted
from ident.diagnosis.left_out import left_out
from ident.diagnosis.nameless import Flexible
from ident.diagnosis.nameless_beside import beside_nameless
from ident.diagnosis.refine import Refined
from ident.diagnosis.settling import (
    as_late,
    in_time,
    late_alone,
    late_as_a_whole,
    late_joints,
    place_of,
    refined_together,
    settled_anew,
    settled_in,
)
from ident.diagnosis.state import Found, State, solved, with_found, without
from ident.diagnosis.sufficiency import (
    ask,
    explained_share,
    heard,
    margin,
    move_alike,
    signals_read,
    sufficiency,
    sufficient,
)
from ident.diagnosis.terms import Term
from ident.diagnosis.weighing import (
    Equivalent,
    Weighed,
    compared,
    could_stand,
    holds,
    main_channel,
    nearly,
    rivals_of,
    side_by_side,
    simplest,
)
from ident.progress import Progress, silent

BUDGET = 40  # hypotheses that are held against the judged rows; the rate is shared among them
STEPS = 14  # effects at most
LATE = 2  # joints of which it is asked whether their torque comes late where nothing else is told
LEAST = 0.25  # share of a channel's whitened residual that is worth saying where it does not carry over
GROUPS = 60  # functions that are asked of a channel: the search that their own evidence has to pay for


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
    alike: tuple[str, ...] = ()  # signals of other joints that it may as well depend on


@dataclass(frozen=True)
class Outcome:
    first: State
    last: State
    steps: tuple[Step, ...]
    unnamed: tuple[Unnamed, ...]
    tau: float
    notes: tuple[str, ...] = field(default=())
    hints: tuple[Step, ...] = ()  # where nothing is told: what may be, of which too few blocks agree

    def with_step(self, at: int, step: Step) -> Outcome:
        """Another step in the place of one."""
        return replace(self, steps=(*self.steps[:at], step, *self.steps[at + 1 :]))


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
    event, loads, on_time = None, True, False
    rounds: list[Weighed] = []
    progress("what the study left out", 0.15)
    whole = left_out(state, library, tau)
    if whole is not None:
        state, missing = whole
        steps += [Step(term, e, ()) for term, e in missing]
    while len(steps) < max_steps:
        done, step = 0.15 + 0.75 * (1 - 0.75 ** len(steps)), f"step {len(steps) + 1}"
        progress(f"{step}: what could be missing", done)
        ranking = ranked(state, library, frozenset(closed))
        listed = short_list(ranking)
        progress(f"{step}: weighing it", done)
        weighed = compared(state, listed, tau, alpha)
        if not weighed.passed and not on_time:
            progress(f"{step}: whether all torques are late", done)
            late = late_as_a_whole(state, library.places, tau, alpha)
            on_time = late is None
            if late is not None:
                taken, evidence, state, beside = late
                steps.append(Step(taken.term, evidence, (), beside))
                continue
        if loads or not weighed.passed:  # where there was none at first, they are asked for again at the end
            progress(f"{step}: loads and contacts", done)
            event = best_event(state, library.events, library.layout, tau, alpha)
            loads = event is not None
        if event is not None and _first(event, weighed) and not _outdone(event, state, weighed, tau, alpha):
            r = event.refined
            rivals = tuple(Equivalent(x.refined.term, x.evidence.log_e) for x in event.rivals)
            steps.append(Step(r.term, event.evidence, rivals))
            state = with_found(state, Found(r.term, r.columns, r.sizes))
            continue
        rounds, unclear = [weighed], None
        told = {u.nearest.term.key for u in unnamed if u.nearest is not None}
        while not weighed.passed:
            unclear = _unclear(state, weighed, told, tau, alpha)
            if unclear is not None:
                break
            further = elsewhere(ranking, listed, tau, BUDGET - len(listed))
            if not further:
                break
            listed += further
            progress(f"{step}: asking the other joints", done)
            weighed = compared(state, further, tau, alpha)
            rounds.append(weighed)
        if unclear is not None:
            state, what = unclear
            if isinstance(what, Step):
                steps.append(what)
            else:
                unnamed.append(what)
                closed.add(state.model.channels[what.channel].joint)
            continue
        if not weighed.passed:
            progress(f"{step}: whether a joint's torque is late", done)
            where = late_joints(state, ranking, tau)[:LATE]
            late = late_alone(state, library.places, where, tau, alpha)
            if late is None:
                break
            taken, evidence, state, beside = late
            steps.append(Step(taken.term, evidence, (), beside))
            continue
        best, evidence = simplest(weighed, tau)
        c = main_channel(evidence, best.term, state)
        where = [p for p in late_joints(state, ranking, tau) if p.joint == best.term.place.joint]
        if best.term.effect.shifts_time or where:
            shifts = best.term.effect.shifts_time
            late = in_time(state, library.places, best.term.place if shifts else where[0], tau, alpha)
            if late is not None and (shifts or late[1].log_e > evidence.log_e + tau):
                taken, evidence, state, beside = late
                others = could_stand(weighed, best, tau)
                steps.append(Step(taken.term, evidence, (), beside if shifts else (*beside, *others)))
                continue
        flex = sufficiency(state, weighed.metric, best, c, tau)
        if flex is not None and not sufficient(best.term, evidence, flex, tau):
            afresh = settled_in(state, weighed, best, c, tau, alpha)
            if afresh is not None:
                taken, evidence, state = afresh
                steps.append(Step(taken.term, evidence, (), could_stand(weighed, best, tau)))
                continue
            alike = move_alike(flex, tau)
            pair = None if alike else _pair(state, weighed, best, flex, tau, alpha)
            if pair is None:
                unnamed.append(
                    Unnamed(
                        c,
                        flex.variables,
                        flex.evidence.log_e,
                        flex.evidence.gain,
                        explained_share(state, c, flex.column),
                        Equivalent(best.term, evidence.log_e),
                        alike=alike,
                    )
                )
                closed.add(state.model.channels[c].joint)
                state = with_found(state, Found(None, {c: flex.column[:, None]}, np.ones(1), flex.variables))
                continue
        rivals = rivals_of(weighed, best, evidence, tau, alpha)
        steps.append(Step(best.term, evidence, rivals, could_stand(weighed, best, tau)))
        state = refined_together(with_found(state, Found(best.term, best.columns, best.sizes)))
    progress("what is left", 0.92)
    state, steps = reconsidered(state, steps, tau, alpha)
    state, steps = pruned(state, steps, tau, alpha)
    state, steps, left = leftovers(state, steps, unnamed, tau, alpha)
    there = {term.key for term in state.terms}  # what is found itself is no other explanation of the rest
    steps = [replace(s, equivalent=tuple(e for e in s.equivalent if e.term.key not in there)) for s in steps]
    steps = [replace(s, passed=(*s.passed, *as_late(s.term, library.places, s.passed))) for s in steps]
    silent_end = not (steps or unnamed or left or state.found)
    near = [its for weighed in rounds for its in nearly(weighed, tau, alpha)] if silent_end else []
    hints = tuple(Step(r.term, e, beside) for r, e, beside in near)
    return Outcome(first, state, tuple(steps), (*unnamed, *left), tau, hints=hints)


def _first(event: Event, weighed: Weighed) -> bool:
    """A load that says more than every other explanation is taken before them."""
    return not weighed.passed or event.evidence.log_e > max(e.gain + e.log_e for _, e in weighed.passed)


def _outdone(event: Event, state: State, weighed: Weighed, tau: float, alpha: float) -> bool:
    """Whether a law that may be, though too few blocks speak for it to be told, leaves the load nothing to
    say: a base's tilt of 3 mrad was told as a force on all but a second of a run."""
    r = event.refined
    load = Found(r.term, r.columns, r.sizes)
    likely = [(o, e) for o, e in weighed.possible if e.log_e > tau and e.gain > event.evidence.gain]
    return any(
        not still_holds(solved(state.plus(Found(o.term, o.columns, o.sizes))), load, tau, alpha)
        for o, _ in likely
        if set(o.columns) & set(r.columns)
    )


def _unclear(
    state: State, weighed: Weighed, told: Collection[tuple], tau: float, alpha: float
) -> tuple[State, Step | Unnamed] | None:
    """Where nothing passed as it is: the state with what holds in other rows, or once it was settled in, or
    with what a shape at the end of its range stands for; None: nothing. told: as of `_at_an_end`."""
    hidden = by_halves(state, weighed, tau, alpha) or by_common(state, weighed, tau, alpha)
    if hidden is not None:
        r, e, others = hidden
        step = Step(r.term, e, tuple(Equivalent(o.term, n.log_e) for o, n in others))
        return refined_together(with_found(state, Found(r.term, r.columns, r.sizes))), step
    held = _doubtful(state, weighed, tau, alpha)
    if held is not None:
        r, e, settled, same = held
        return settled, Step(r.term, e, same, could_stand(weighed, r, tau))
    end = _at_an_end(state, weighed, told, tau, alpha)
    if end is None:
        return None
    r, e = end
    c = main_channel(e, r.term, state)
    read = tuple(sorted(signals_read(r.term) or ()))
    share = explained_share(state, c, r.columns[c] @ r.sizes)
    what = Unnamed(c, read, e.log_e, e.gain, share, Equivalent(r.term, e.log_e))
    return with_found(state, Found(None, r.columns, r.sizes, read)), what


def _doubtful(
    state: State, weighed: Weighed, tau: float, alpha: float
) -> tuple[Refined, Evidence, State, tuple[Equivalent, ...]] | None:
    """Where nothing holds but something says much, or upsets the judged rows: whether it holds once it was
    settled in, and what would explain as much."""
    likely = [(r, e) for r, e in weighed.all if e.log_e > tau and e.gain > tau and not r.at_bound]
    if not likely:
        return settled_anew(state, weighed, tau, alpha)
    best, evidence = max(likely, key=lambda its: its[1].log_e)
    held = settled_in(state, weighed, best, main_channel(evidence, best.term, state), tau, alpha)
    return None if held is None else (*held, ())


def _at_an_end(
    state: State, weighed: Weighed, told: Collection[tuple], tau: float, alpha: float
) -> tuple[Refined, Evidence] | None:
    """What would hold but for a shape at the end of its range: something is there, and it is not this. told:
    keys of what was nearest to such before."""
    here = [(r, e) for r, e in weighed.all if r.at_bound and r.term.key not in told]
    inside = [(replace(r, at_bound=()), e) for r, e in here]
    ended = [(r, e) for r, e in inside if holds(state, weighed.metric, r, e, tau, alpha)]
    return max(ended, key=lambda its: its[1].log_e, default=None)


def _pair(
    state: State, weighed: Weighed, best: Refined, flex: Flexible, tau: float, alpha: float
) -> Refined | None:
    """Another effect on the channel beside which the best one is sufficient after all."""
    for other, _ in weighed.all:
        if other.term.key == best.term.key or not set(other.columns) & set(best.columns):
            continue
        together = weigh(weighed.metric, side_by_side(best, other))
        asked = flex.evidence.log_e + margin(max(best.term.free, other.term.free), tau)
        if together.log_e > asked and together.supported(alpha):
            return other
    return None


def reconsidered(state: State, steps: list[Step], tau: float, alpha: float) -> tuple[State, list[Step]]:
    """Each effect weighed again against what could have stood in its place, beside all that was found since:
    what was missing then can have made one explanation look better than it is, or a simpler one too poor."""
    for number, f in enumerate(state.found):
        at = next((k for k, s in enumerate(steps) if f.term is not None and s.term.key == f.term.key), None)
        if f.term is None or at is None:
            continue
        beside = {t.key: t for t in (*steps[at].passed, *(e.term for e in steps[at].equivalent))}
        if not set(beside) - {f.term.key}:
            continue
        others = state.but(number)
        trials = list({**beside, f.term.key: f.term}.values())
        weighed = compared(others, [Ranked(t, 0.0) for t in trials], tau, alpha)
        if not weighed.passed:
            continue
        best, evidence = simplest(weighed, tau)
        rivals = rivals_of(weighed, best, evidence, tau, alpha)
        if best.term.key == f.term.key:
            steps[at] = replace(steps[at], equivalent=rivals)
            continue
        flex = sufficiency(others, weighed.metric, best, main_channel(evidence, best.term, others), tau)
        if not sufficient(best.term, evidence, flex, tau):
            continue
        steps[at] = Step(best.term, evidence, rivals, steps[at].passed)
        found = list(state.found)
        found[number] = Found(best.term, best.columns, best.sizes)
        state = refined_together(solved(replace(state, found=tuple(found))))
    return state, steps


def swapped(outcome: Outcome, at: int, term: Term) -> Outcome:
    """Another explanation in the place of a step's, settled beside the rest."""
    state, step = outcome.last, outcome.steps[at]
    number = place_of(state, step.term)
    others = state if number is None else state.but(number)
    columns = others.scene.columns(term)
    if number is None or not columns:
        return outcome
    state = refined_together(with_found(others, Found(term, columns, np.array(term.size or [1.0]))))
    if place_of(state, term) is None:
        return outcome
    return replace(outcome, last=state).with_step(at, replace(step, term=term))


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
            log_e = asked_for(others, f, tau)
            if log_e >= tau:
                continue
            if weak is None or log_e < weak[0]:
                weak = (log_e, number)
        if weak is None:
            return state, steps
        gone = state.found[weak[1]].term
        assert gone is not None
        steps = [s for s in steps if s.term.key != gone.key]
        state = without(state, weak[1])


def overrated(state: State, steps: list[Step], tau: float) -> tuple[State, list[Step], dict[int, Unnamed]]:
    """Leave out, one after the other, what does not stand beside functions without a name; with it {channel:
    what was left out there}."""
    doubtful: dict[int, Unnamed] = {}
    while named := [(k, f) for k, f in enumerate(state.found) if f.term is not None and _is_a_law(f.term)]:
        spoken = np.flatnonzero((state.rows.use & state.rows.judged).any(axis=1))
        asked = {int(c): ask(state, state.metric, int(c), tau) for c in spoken}
        functions = {c: flex for c, flex in asked.items() if flex and flex.evidence.log_e < tau}
        says = [(beside_nameless(state.but(k), f, functions, tau), k) for k, f in named]
        log_e, weakest = min(says)
        if log_e > tau:
            break
        others, f = state.but(weakest), state.found[weakest]
        assert f.term is not None
        e = weigh(others.metric, f.columns)
        near = [c for c in functions if e.per_channel[c] > 0 or c in f.columns]
        c = max(near, key=lambda c: (c in f.columns, functions[c].prior_evidence))
        doubtful[c] = _fitted_alone(c, functions[c], state.metric, Equivalent(f.term, e.log_e))
        steps = [s for s in steps if s.term.key != f.term.key]
        state = without(state, weakest)
    return state, steps, doubtful


def _fitted_alone(c: int, flex: Flexible, m: Metric, near: Equivalent | None) -> Unnamed:
    """What does not carry over: its share is that of the rows that it was learned on, whitened."""
    told = flex.evidence
    wide = float(1 - np.exp(-2 * told.gain / m.fitted.free[c]))
    return Unnamed(c, flex.variables, told.log_e, told.gain, wide, near, carries_over=False)


def _is_a_law(term: Term) -> bool:
    """Not a load of one run, nor what the study itself left out, which is there whatever else is."""
    return term.place.recording is None and not term.effect.replaces


def asked_for(others: State, f: Found, tau: float) -> float:
    """log E of what was found on the judged rows of a state without it; infinite where these cannot show it
    and the fitted ones beside them ask for it."""
    log_e = weigh(others.metric, f.columns).log_e
    return np.inf if log_e < tau and shown_by_fitted(others, f.columns, f.sizes, tau) else log_e


def leftovers(
    state: State, steps: list[Step], unnamed: Sequence[Unnamed], tau: float, alpha: float
) -> tuple[State, list[Step], list[Unnamed]]:
    """What functions of everything still explain, channel by channel; names beside it must hold alone. What
    does not carry over is told where nothing else is, `unnamed` included."""
    out: list[Unnamed] = []
    state, steps, doubtful = overrated(state, steps, tau)
    for c in range(state.rows.channels):
        if not (state.rows.use[c] & state.rows.judged).any():
            continue
        flex, m = heard(state, c, tau)
        if flex is None:
            continue
        if flex.evidence.log_e < tau or not flex.evidence.supported(alpha):
            near = doubtful[c].nearest if c in doubtful else None
            alone = _fitted_alone(c, flex, m, near)
            enough = flex.prior_evidence > tau + np.log(GROUPS * state.rows.channels)
            if near is not None or (alone.share > LEAST and enough):
                out.append(alone)
            continue
        share = explained_share(state, c, flex.column)
        column = Found(None, {c: flex.column[:, None]}, np.ones(1), flex.variables)
        for number, f in reversed(list(enumerate(state.found))):
            if f.term is None or f.term.place.joint is None or c not in f.columns:
                continue
            others = state.but(number)
            learned = ask(others, others.metric, c, tau)
            if learned is None or sufficient(f.term, weigh(others.metric, f.columns), learned, tau):
                continue  # a law still; what is left is told beside it
            beside = solved(others.plus(replace(column, columns={c: learned.column[:, None]})))
            if asked_for(beside, f, tau) < tau:
                steps = [s for s in steps if s.term.key != f.term.key]
                state = without(state, number)
        near = doubtful[c].nearest if c in doubtful else None
        out.append(Unnamed(c, flex.variables, flex.evidence.log_e, flex.evidence.gain, share, near))
    there = {u.channel for u in out}
    out += [u for c, u in doubtful.items() if c not in there]
    if steps or unnamed or any(u.carries_over for u in out):
        out = [u for u in out if u.carries_over or u.nearest is not None]
    return state, steps, out
