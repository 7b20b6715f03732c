"""What a check of signals is before it is one: a hypothesis, with what it explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.equations.columns import Columns
from ident.examination.check import Check
from ident.examination.quick import Assignment, Fit, Quick

CLEARLY = 0.7  # gain: one channel's error is halved
EXPLAINED = 0.5  # error of a torque above which no fault of it is believed: something else is missing
NOTHING = 0.85  # error of a channel that the model does not explain


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What would be different, how much better it fits, and the check that says so. words: the same beside
    another that explains as much; own: the blamed joint's own friction says so, whatever else is missing."""

    gain: float
    how: Assignment
    check: Check
    quick: Quick | None = None  # with other motions
    words: str = ""
    own: bool = False

    def beside(self, others: Sequence[Hypothesis]) -> Hypothesis:
        """With others that these recordings do not tell from it. The line of this one stays the first, so
        that what is asked next can be asked without it; those of the others are YAML's comment."""
        message = self.check.message
        others = [its for its in others if its.words not in message]  # a position beside its torque, twice
        if not others:
            return self
        end = min((k for k in (message.find(": "), message.find("; ")) if k > 0), default=len(message))
        also = "".join(f", or {its.words}" for its in others)
        lines = dict.fromkeys(its.check.remedy for its in others if its.check.remedy != self.check.remedy)
        check = replace(
            self.check,
            message=f"{message[:end]}{also}, these recordings do not tell which{message[end:]}",
            remedy=self.check.remedy + (f"  # or {' or '.join(lines)}, where it is that" if lines else ""),
        )
        return replace(self, check=check)


def signal_of(columns: Columns, c: int, currents: bool) -> str:
    """The study's name of the signal behind a channel."""
    name = columns.channels[c]
    return "i" + name[5:] if currents and name.startswith("tau_m") else name


def falls(before: Fit, after: Fit) -> str:
    a, b = (100 * float(np.sqrt(np.nanmean(x.error**2))) for x in (before, after))
    return f"the error falls from {a:.0f} to {b:.0f} %"
