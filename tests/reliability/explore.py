"""Runs any number of mutated inputs and counts what came of them.

The seed of every chunk is printed with what failed in it; a failure is shrunk to its smallest input.
"""

from __future__ import annotations

import random
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from hypothesis import HealthCheck, Phase, find, given, seed, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from tests.reliability.judge import HANG_S, Case, Outcome, judged

CHUNK = 500
SHRINKS = 300  # trials for the smallest input


@dataclass
class Tally:
    """Outcomes of a kind of input; `failures`: what failed -> (seed, the first such input)."""

    name: str
    outcomes: Counter[str] = field(default_factory=Counter)
    planted: Counter[str] = field(default_factory=Counter)
    failures: dict[Outcome, tuple[int, Any]] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def inputs(self) -> int:
        return sum(self.outcomes.values())


def explore(
    name: str,
    cases: st.SearchStrategy[Case],
    trial: Callable[[Any], Any],
    inputs: int,
    first_seed: int = 0,
    chunk: int = CHUNK,
    shrink: bool = True,
    seconds: float = HANG_S,
) -> Tally:
    """Try `inputs` inputs of `cases`, in chunks with the seeds first_seed, first_seed + 1, ..."""
    tally, start = Tally(name), time.monotonic()
    number = first_seed
    while tally.inputs < inputs:
        _chunk(tally, cases, trial, min(chunk, inputs - tally.inputs), number, seconds)
        number += 1
        tally.seconds = time.monotonic() - start
        if sys.stderr.isatty():
            bad = len(tally.failures)
            print(f"\r{name}: {tally.inputs}/{inputs}, {bad} kinds of failure", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    if shrink:
        for outcome, (found, case) in list(tally.failures.items()):
            if outcome.kind != "hang" and tally.seconds / tally.inputs < 1:  # else shrinking takes hours
                tally.failures[outcome] = found, _smallest(cases, trial, outcome, found) or case
    return tally


def _chunk(
    tally: Tally,
    cases: st.SearchStrategy[Case],
    trial: Callable[[Any], Any],
    inputs: int,
    number: int,
    seconds: float,
) -> None:
    left = inputs

    @seed(number)
    @settings(
        max_examples=inputs,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(cases)
    def one(case: Case) -> None:
        nonlocal left
        left -= 1
        outcome = judged(trial, case, seconds)
        tally.outcomes[outcome.kind] += 1
        tally.planted[case.planted] += bool(case.planted)
        if outcome.bad:
            tally.failures.setdefault(outcome, (number, case))

    one()
    if left > 0:  # hypothesis ran out of different inputs
        tally.outcomes["repeated"] += left


def _smallest(
    cases: st.SearchStrategy[Case], trial: Callable[[Any], Any], outcome: Outcome, number: int
) -> Case | None:
    quiet = settings(
        max_examples=CHUNK, deadline=None, database=None, suppress_health_check=list(HealthCheck)
    )
    tried = 0

    def same(case: Case) -> bool:
        nonlocal tried
        tried += 1
        return tried <= CHUNK + SHRINKS and judged(trial, case) == outcome

    try:
        return find(cases, same, settings=quiet, random=random.Random(number))
    except NoSuchExample:
        return None


COLUMNS = ("accepted", "refused", "traceback", "babble", "hang", "silent", "repeated")


def table(tallies: list[Tally]) -> str:
    """What the command prints at the end."""
    head = ("", "inputs", "planted", *COLUMNS, "seconds")
    rows = [
        (t.name, t.inputs, sum(t.planted.values()), *(t.outcomes[c] for c in COLUMNS), round(t.seconds))
        for t in tallies
    ]
    wide = [max(len(str(row[k])) for row in (head, *rows)) for k in range(len(head))]
    lines = [
        "  ".join(
            str(value).rjust(w) if k else str(value).ljust(w) for k, (value, w) in enumerate(zip(row, wide))
        )
        for row in (head, *rows)
    ]
    for t in tallies:
        for outcome, (number, case) in t.failures.items():
            shown = repr(case.content if isinstance(case, Case) else case)
            lines += ["", f"{t.name}, seed {number}: {outcome.kind}, {outcome.where}", f"  {shown[:1500]}"]
    return "\n".join(lines)
