"""What the residual is traced to: the loop on rows, then the extended study, fitted whole, which has the last
word on what is kept."""

from __future__ import annotations

from dataclasses import dataclass

from ident.diagnosis.extended.compared_exactly import compared_exactly, replaced
from ident.diagnosis.extended.last_fit import Refused, extended, first_extended
from ident.diagnosis.extended.remaining import remaining
from ident.diagnosis.loop import trace
from ident.diagnosis.opening import Opened
from ident.diagnosis.outcome import Outcome
from ident.diagnosis.search.candidates import Library
from ident.diagnosis.telling.findings import Unexplained, not_told
from ident.diagnosis.working import Working
from ident.estimation.fit import FitResult
from ident.progress import Progress, part_of, silent


@dataclass(frozen=True)
class Traced:
    """outcome: of the loop, as the last fit leaves it; last: the extended study's fit; refused: what that fit
    does not bear out; no_better: what was found and made the runs that judge no better."""

    outcome: Outcome
    last: FitResult
    refused: Refused
    no_better: tuple[Unexplained, ...]


def trace_whole(its: Working, begun: Opened, library: Library, alpha: float, progress: Progress) -> Traced:
    outcome = trace(begun.state, library, alpha, part_of(progress, 0.0, 0.87))
    again, last, refused = first_extended(
        its.known, outcome, its.base, begun, alpha, part_of(progress, 0.87, 1.0)
    )
    outcome, last, refused = replaced(again, outcome, its.base, last, refused, alpha)
    no_better: list[Unexplained] = []
    while (rest := remaining(outcome, last, refused, alpha)) is not outcome:
        no_better += [u for u in not_told(outcome, refused) if u.errors is not None]
        outcome = rest
        last, refused = extended(again, outcome, its.base, alpha, silent)
    outcome, last, refused = compared_exactly(again, outcome, its.base, last, refused, alpha)
    return Traced(outcome, last, refused, tuple(no_better))
