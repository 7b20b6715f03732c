"""What a loop found: its steps, what has no name, and the state that holds both."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence
from ident.diagnosis.evidence.state import State
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.weighing import Equivalent

BUDGET = 40  # hypotheses that are held against the judged rows; the rate is shared among them


def threshold(alpha: float) -> float:
    return float(np.log(BUDGET / alpha))


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
    times_noise: float | None = None  # of the change that keeps `nearest` away, the parameters', or
    of_its_kind: bool = False  # that of others of its kind
    on_fitted: tuple[float, float] | None = None  # nats of `nearest`, and of functions, if these keep it away
    unseen: bool = False  # the judged rows do not go where it acts: they could not show it


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
