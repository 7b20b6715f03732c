"""Faults that the fitted recordings do not show, and without which the others would be predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check
from ident.examination.quick import gain_of

CARRIED, KEPT = 2.2, 0.3  # gain on identify and validate together, and what identify may lose by it


@dataclass(frozen=True, slots=True)
class Carried:
    """A fault without which the model would predict validate, though the fitted recordings do not show it:
    gain on both together, what it is, and the gravity (3,) that it stands for, if it is one."""

    gain: float
    words: str
    gravity: np.ndarray | None = None


def carried(before: np.ndarray, after: np.ndarray, held: np.ndarray | None, now: np.ndarray | None) -> float:
    """Gain on identify (before, after) and validate (held, now) together, by errors (C,): minus infinity
    where a torque of validate is predicted worse than by nothing, or identify loses too much."""
    if held is None or now is None or not np.nanmax(now) < 1.0 or gain_of(before, after) < -KEPT:
        return -np.inf
    return gain_of(before, after) + gain_of(held, now)


def ambiguous(held: np.ndarray | None, told: Sequence[Carried]) -> Check:
    """All that would explain recordings that are foretold badly; none is believed."""
    assert held is not None
    words = "; ".join(its.words for its in sorted(told, key=lambda its: -its.gain))
    return Check(
        "poor_excitation",
        (),
        f"what is fitted does not predict the recordings that validate (errors of {span(held)}), and its "
        f"motions do not show why: {words}: "
        f"{'each of these' if len(told) > 1 else 'this'} alone would predict them far better",
        "check each of them, and record a motion that moves all joints more",
    )


def span(error: np.ndarray) -> str:
    return f"{100 * np.nanmin(error):.0f} to {100 * np.nanmax(error):.0f} %"
