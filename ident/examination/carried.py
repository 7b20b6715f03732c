"""Faults that the fitted recordings do not show, and without which the others would be predicted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.examination.check import Check
from ident.examination.hypothesis import signal_of
from ident.examination.quick import Assignment, Fit, Quick, gain_of
from ident.examination.rivals import rivals
from ident.examination.signs import evidence
from ident.examination.stretches import ODD, Explained, agreed, all_rows

CARRIED, KEPT = 2.2, 0.3  # gain on identify and validate together, and what identify may lose by it
ABSURD = 1e3  # a torque's factor
BEHIND = 0.5  # gain by which one fault is clearly behind another


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


def carried_faults(quick: Quick, fit: Fit, how: Assignment, currents: bool) -> list[Carried]:
    """Faults that one number describes, each with the number with which validate is predicted best, where the
    best of them is so by far: those that are not clearly behind it."""
    told = [*_scales(quick, fit, how, currents), *_others(quick, fit, how, currents)]
    most = max((its.gain for its in told), default=-np.inf)
    return [its for its in told if its.gain > most - BEHIND] if most > CARRIED else []


def _scales(quick: Quick, fit: Fit, how: Assignment, currents: bool) -> Iterator[Carried]:
    for c in np.flatnonzero(quick.identify.rows > 10).tolist():
        tried = []
        for factor in (sign * f for f in np.geomspace(1 / ABSURD, ABSURD, 61) for sign in (1, -1)):
            other = quick.fit(how.times([c], factor))
            tried.append((carried(fit.error, other.error, fit.validate, other.validate), factor))
        value, factor = max(tried)
        taken = how.times([c], factor)
        alone = max(its[0] for its in tried if abs(its[1]) in (ABSURD, 1 / ABSURD))  # as if no other felt it
        if value > max(CARRIED, alone + BEHIND) and not evidence(quick, quick.fit(taken), taken).against(c):
            words = f"{signal_of(quick.columns, c, currents)} times {factor:.2g}"
            yield from _kept(Carried(value, words), quick, how, quick, taken)


def _others(quick: Quick, fit: Fit, how: Assignment, currents: bool) -> Iterator[Carried]:
    roles = [s.role for s in quick.samples]
    for rival in rivals(all_rows(quick), how, currents):
        samples = [replace(s, role=role) for s, role in zip(rival.explained.quick.samples, roles)]
        taken = quick.of(samples)
        after = taken.fit(how)
        value = carried(fit.error, after.error, fit.validate, after.validate)
        if value > CARRIED:
            yield from _kept(Carried(value, rival.words), quick, how, taken, how)


def _kept(its: Carried, quick: Quick, how: Assignment, other: Quick, taken: Assignment) -> Iterator[Carried]:
    """A fault where stretch by stretch validate is predicted better without it, and identify not explained
    worse."""
    (fitted, held), (fitted_so, held_so) = (_explained(*each) for each in ((quick, how), (other, taken)))
    if agreed(held, held_so, ODD) and not agreed(fitted_so, fitted, ODD):
        yield its


def _explained(quick: Quick, how: Assignment) -> tuple[Explained, Explained]:
    """What a fit takes of the recordings that it is of, and of those that judge it."""
    fit = quick.fit(how)
    assert fit.validate is not None
    judging = quick.of([replace(s, role="identify") for s in quick.samples if s.role == "validate"])
    return Explained(quick, fit, how), Explained(judging, replace(fit, error=fit.validate), how)


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
