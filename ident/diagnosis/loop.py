"""The loop: rank what could be missing, add the best that held-out data confirm, fit again, until nothing
is left."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.acceptance import Step, gains, main_channel, required, try_candidate
from ident.diagnosis.candidates import OWN_TERMS, all_terms, build_library
from ident.diagnosis.events import block_folds
from ident.diagnosis.generic_rival import Rival, best_rival, build_generic
from ident.diagnosis.noise_floor import white_floor
from ident.diagnosis.plausibility import physical
from ident.diagnosis.ranking import Search, rank
from ident.diagnosis.state import Found, State, refit, stack_columns
from ident.diagnosis.terms import Term

MAX_TERMS = 14
SECONDS = 4  # candidates tried beside an accepted term
TRIES = 5
SMALLEST_SHARE = 0.02  # of the strongest finding's gain
SHARE_BESIDE_UNEXPLAINED = 0.25  # of the gain of what has no name: its echoes are smaller
LEFT_GAIN, LEFT_HELD_GAIN = 40.0, 15.0  # of a nameless explanation of what is left
LEFT_SHARE = 0.10  # of the residual's variance, on both kinds of rows; coloured noise gives some per cent
ABOVE_FLOOR = 8.0  # times the white floor (it misses slow noise): structure, where held-out rows agree
FAR_ABOVE_FLOOR = 15.0  # structure, whatever it depends on
SMALL_PART = 0.25
PLAIN_GAIN, PLAIN_SHARE = 400.0, 0.5  # structure on fitted rows alone: held-out motion may differ too much


@dataclass(frozen=True)
class Outcome:
    steps: tuple[Step, ...]
    first: State
    last: State
    unexplained: tuple[Rival, ...]


@dataclass(frozen=True)
class Leftover:
    """Structure without a name: its gain and the sum of squares it explains, 0 unless held-out rows agree."""

    rival: Rival
    gain: float
    energy: float


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
    for left in leftovers(state, search, blocked, strongest):
        unexplained.append(left.rival)
        impostors = {s.accepted.key for s in steps if s.accepted is not None and took_part_of(s, left)}
        if impostors:
            steps = [s for s in steps if s.accepted is None or s.accepted.key not in impostors]
            state = refit(state, [f for f in state.found if f.term is None or f.term.key not in impostors])
    return Outcome(tuple(steps), first, state, tuple(unexplained))


def took_part_of(step: Step, left: Leftover) -> bool:
    """A finding of one joint that explains little beside what has no name there: a part of that."""
    term, c = step.accepted, left.rival.channel
    if (
        term is None
        or term.effect.name in OWN_TERMS
        or term.effect.joints == "robot"
        or c not in term.channels
    ):
        return False
    energy = float(step.before.system.rss[c] - step.after.system.rss[c])
    return step.gain + step.held_out < left.gain or energy < SMALL_PART * left.energy


def challenge(state: State, step: Step, search: Search, blocked: set[int]) -> tuple[Rival | None, bool]:
    """Does a nameless explanation beat the accepted term clearly on its main channel?"""
    term = step.accepted
    assert term is not None
    if term.effect.name in OWN_TERMS:  # the study itself left it out, so it is there, whatever else is
        return None, False
    c = term.channels[0] if len(term.channels) == 1 else main_channel(step)
    joint = state.context.view.joint_of[c]
    done = {t.key for t in step.after.terms}
    if c in blocked or any(left_out(t, joint) and t.key not in done for t in search.terms):
        return None, False  # what the study left out there would look like a rival
    rival = best_rival(search.generic, state.system, c, state.context)
    if rival is None:
        return None, False
    every_row = state.system.score({c: rival.columns}, share=np.ones(len(state.system.y)))
    if every_row.total < 1.05 * max(step.raw_total, best_pair(state, step, c)):
        return rival, False
    nuisance = Found(None, {c: rival.columns}, rival.score.coefficients, "unexplained")
    gain, held = gains(state.system, refit(state, [*state.found, nuisance], turns=1).system)
    if gain + held < 1.1 * (step.gain + step.held_out) + 10:
        return rival, False
    return rival, True


def best_pair(state: State, step: Step, c: int) -> float:
    """Score of the accepted term with the best second one on its channel: a rival has two columns as well.
    Two shapes over the position together can draw anything, so they do not count as two effects."""
    system, every = state.system, np.ones(len(state.system.y))
    own = next(x for x in step.ranking if step.accepted is not None and x.term.key == step.accepted.key)
    others = [x for x in step.ranking if x is not own and not x.event and c in x.columns]
    if is_shape(own.term):
        others = [x for x in others if not is_shape(x.term)]
    best = 0.0
    for other in others[:SECONDS]:
        both = stack_columns(state.bank, [own.columns, other.columns])
        touched = {*own.columns, *other.columns}
        best = max(best, system.score({k: both[k] for k in touched}, share=every).total)
    return best


def is_shape(term: Term) -> bool:
    """A torque over the joint's own position alone."""
    return term.effect.needs == {"q"}


def left_out(term: Term, joint: int) -> bool:
    """A term of the paper's own model, on this joint, that the study leaves out."""
    return term.effect.name in OWN_TERMS and term.joint == joint


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


def leftovers(state: State, search: Search, blocked: set[int], strongest: float) -> list[Leftover]:
    """Channels with structure left: a nameless explanation confirmed on held-out rows, or far above the noise
    floor."""
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
        if rival.score.identify < SMALL_PART * LEFT_GAIN and not above:
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
            energy = float(state.system.rss[c] - after.rss[c])
            told = replace(rival, share_percent=float(percent))
            out.append(Leftover(told, *((gain + held, energy) if confirmed else (0.0, 0.0))))
    return out
