"""How much torques of an effect's own kind, at other shapes, change from one set of rows to the other.

What a model gets wrong from run to run is smooth for the most part, and its own parameters show how large it
is (parameters_apart.py); a wave of thirty periods a turn has little part in that. How much of it such waves
have, others show that are not there: the same effect at other wavenumbers, so far off that they say nothing
of this one's torque. Fitted to either side, their sizes differ by what noise makes them, or by so many times
more. (Of a Barrett's joint its parameters change by 7 times the noise, waves of 10 to 93 periods a radian by
1.1: a ripple of 42 nats was a function of its position without a name.)"""

from __future__ import annotations

import numpy as np

from ident.diagnosis.evidence.metric import Metric, beside_model
from ident.diagnosis.evidence.state import Found, State
from ident.diagnosis.rows.terms import Term

OTHERS = tuple(1.15**k for k in (-8, 8, -7, -6, -5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6, 7))  # of a shape
OWN = 0.1  # share of its torque that another shape may say
FEWEST = 10  # numbers that tell a ratio of squares to half of it


def times_noise_of_its_kind(others: State, m: Metric, f: Found) -> float | None:
    """Squares by which sizes of other shapes differ between the sides of a metric, in units of what noise
    makes them, one at least; None where too few are apart from it. others: the state without it."""
    if f.term is None:
        return None
    squares, numbers = 0.0, 0
    bounds = f.term.effect.bounds(f.term.place)
    for name, own in f.term.theta.items():
        low, high = bounds.get(name, (-np.inf, np.inf))
        for at, times in enumerate(OTHERS):
            if at == 2 and not numbers:  # neither a third nor three times of it is another one
                break
            if not low <= own * times <= high:  # beyond its bounds it may be no number at all
                continue
            told = _apart(others, m, f, f.term.at(**{name: own * times}))
            squares, numbers = squares + told[0], numbers + told[1]
    return max(1.0, squares / numbers) if numbers >= FEWEST else None


def _apart(others: State, m: Metric, f: Found, term: Term) -> tuple[float, int]:
    """The square of the distance of another shape's sizes between the sides, beside the effect's own, in
    their noise, and how many these are; nothing of one that says part of its torque."""
    columns = others.scene.columns(term)
    if set(columns) != set(f.columns):
        return 0.0, 0
    own, white = m.whiten(f.columns), m.whiten(columns)
    left, _ = beside_model(m, m.fitted, {c: np.column_stack([z, own[c] @ f.sizes]) for c, z in white.items()})
    across, whole = left[:-1, -1], left[-1, -1]
    if across @ np.linalg.pinv(left[:-1, :-1], rcond=1e-9) @ across > OWN * whole:
        return 0.0, 0
    p = len(across)
    both = {c: np.hstack([z, own[c]]) for c, z in white.items()}
    apart, spread = np.zeros(p), np.zeros((p, p))
    for side, sign in ((m.fitted, 1.0), (m.judged, -1.0)):
        left, right = beside_model(m, side, both)
        told = right[p:] @ np.linalg.pinv(left[p:, p:], rcond=1e-9) @ right[p:]
        noise = float(sum(side.rss[c] for c in both) - told) / max(sum(side.free[c] for c in both), 1)
        inverse = np.linalg.pinv(left, rcond=1e-9)
        apart, spread = apart + sign * (inverse @ right)[:p], spread + noise * inverse[:p, :p]
    return float(apart @ np.linalg.pinv(spread, rcond=1e-9) @ apart), len(apart)
