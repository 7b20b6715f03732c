"""What a check of signals is before it is one: a hypothesis, with what it explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ident.equations.columns import Columns
from ident.examination.check import Check
from ident.examination.quick import Assignment, Fit, Quick

CLEARLY = 0.7  # gain: one channel's error is halved
EXPLAINED = 0.5  # error of a torque above which no fault of it is believed: something else is missing
NOTHING = 0.85  # error of a channel that the model does not explain


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What would be different, how much better it fits, and the check that says so."""

    gain: float
    how: Assignment
    check: Check
    quick: Quick | None = None  # with other motions


def signal_of(columns: Columns, c: int, currents: bool) -> str:
    """The study's name of the signal behind a channel."""
    name = columns.channels[c]
    return "i" + name[5:] if currents and name.startswith("tau_m") else name


def falls(before: Fit, after: Fit) -> str:
    a, b = (100 * float(np.sqrt(np.nanmean(x.error**2))) for x in (before, after))
    return f"the error falls from {a:.0f} to {b:.0f} %"
