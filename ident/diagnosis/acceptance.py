"""Whether a candidate stays: fitted together with everything, on rows fitted and on rows never fitted."""

from dataclasses import dataclass

import numpy as np

from ident.diagnosis.candidates import OWN_TERMS
from ident.diagnosis.contact_point import settle_contact
from ident.diagnosis.nuisance import beyond_terms
from ident.diagnosis.plausibility import implausible, physical
from ident.diagnosis.ranking import Candidate
from ident.diagnosis.rotor_split import settle_rotor
from ident.diagnosis.scoring import System
from ident.diagnosis.settling import LATE, resettle_fully
from ident.diagnosis.state import Found, State, refine, refit
from ident.diagnosis.terms import Term

FIRST_GAIN = 25.0  # log-likelihood on fitted rows; Bonferroni asks 14, impostors of real friction reach 20
HELD_GAIN = 8.0
OWN_GAIN, OWN_HELD_GAIN = 14.0, 4.0  # of a term that the study itself left out: it has no impostors
SMALLEST_DROP = 0.04  # of a channel's held-out error: below it, impostors outnumber effects
EVENT_GAIN, EVENT_HELD_GAIN = 40.0, 18.0  # thousands of windows are searched
SMALLEST_EVENT_DROP = 0.05  # of a channel's error over all runs
HOPELESS = 0.4  # of the gain asked: no split of inertias lifts a candidate over that
LEAST_AGREEMENT = 0.15  # held-out gain a fitted gain must bring


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


def try_candidate(state: State, candidate: Candidate, ranking, least: float) -> Step | None:
    """Fit with the candidate; keep it when both kinds of rows confirm it with effective sample counts."""
    found = [*state.found, Found(candidate.term, candidate.columns, candidate.score.coefficients)]
    after = refine(refit(state, found))
    if candidate.term.effect.name in LATE:
        after = resettle_fully(after)
    first, second = (EVENT_GAIN, EVENT_HELD_GAIN) if candidate.event else required(candidate.term)
    if not candidate.event and gains(state.system, after.system)[0] < HOPELESS * first:
        return None
    after = settle_contact(settle_rotor(after))
    gain, held = gains(state.system, after.system)
    moments = beyond_terms(candidate.term, candidate.columns)
    if moments:
        alone = state.system.score(moments)
        gain, held = gain - alone.identify, held - alone.held_out
    if candidate.event:
        gain, held = candidate.effective
        elsewhere = float(state.folds.by_validation)  # else the fitted rows are all there are
        before_all, after_all = (s.rss + elsewhere * s.rss_held for s in (state.system, after.system))
        if largest_drop(before_all, after_all)[0] < SMALLEST_EVENT_DROP:
            return None
    elif (
        candidate.term.effect.name not in OWN_TERMS
        and held_out_drop(state.system, after.system) < SMALLEST_DROP
    ):
        return None
    if gain < max(first, least) or held < second:
        return None
    balanced = 1.0 if candidate.event or not state.folds.by_validation else _balance(state.system)
    if held < LEAST_AGREEMENT * gain * balanced or implausible(after.found[-1], after.context):
        return None
    if not lowers_its_own(candidate.term, state, after):
        return None
    if not all(physical(f) for f in after.found[:-1]):  # it would turn an earlier finding's sign around
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


def lowers_its_own(term: Term, before: State, after: State) -> bool:
    """An effect of a joint must lower the held-out error there, not only that of its neighbours."""
    own = [c for c in term.channels if before.context.view.joint_of[c] == term.joint]
    if not own or not before.system.rss_held.any():
        return True
    return bool(after.system.rss_held[own].sum() < before.system.rss_held[own].sum())


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


def main_channel(step: Step) -> int:
    """Channel whose error on the fitted rows falls most."""
    before, after = step.before.system, step.after.system
    return int(np.argmax(np.log(before.rss / after.rss)))
