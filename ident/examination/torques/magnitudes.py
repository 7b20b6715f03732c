"""A torque that is recorded without its sign: as a magnitude.

A table shows that only where the torque comes down to zero often. What bodies and the other torques ask for
tells the sign that is missing, sample by sample. (Of a Franka's third torque without its sign, that passes
zero five times while it is fitted, the other sign was told.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ident.examination.check import Check
from ident.examination.fits.hypothesis import CLEARLY, Asked, Hypothesis, falls
from ident.examination.fits.quick import Quick
from ident.examination.fits.samples import RAIL, Sample
from ident.examination.fits.stretches import RARE, Explained, all_rows, steadily

TURNS = 6  # of signs by a fit, and of a fit by signs
UNSIGNED = "is recorded without its sign"


def magnitudes(asked: Asked) -> Iterator[Hypothesis]:
    """Each torque that has one sign in all recordings, with the sign that the model predicts."""
    for c in asked.seen:
        taken = signed(asked, asked.quick, c)
        if taken is None or not asked.better(taken.fit(asked.how), CLEARLY):
            continue
        other = taken.fit(asked.how)
        one, its = (Explained.by(all_rows(quick), asked.how) for quick in (asked.quick, taken))
        if steadily(one, its, RARE):
            words = f"{asked.name(c)} {UNSIGNED}"
            said = f"{words}, as a magnitude: with the sign that the model predicts {falls(asked.fit, other)}"
            check = Check("unsigned_torque", (asked.name(c),), said, remedy(asked, c))
            yield Hypothesis(other.gain_over(asked.fit), asked.how, check, taken, words)


def signed(asked: Asked, quick: Quick, c: int, label: str = "") -> Quick | None:
    """The recordings, or one of them, with a torque's signs as the model predicts them: of bodies that the
    other torques show, then of a fit of them all. None of a clipped torque, of one of both signs, and where
    that is no more than the other sign."""
    how, which = asked.how, [s for s in quick.samples if label in ("", s.label)]
    if asked.name(c) in asked.clipped or not one_sided(which, how.order[c]):
        return None
    k, its = how.order[c], [label in ("", s.label) for s in quick.samples]
    made = quick.of([s.without([c]) if mine else s for s, mine in zip(quick.samples, its)])
    for _ in range(TURNS):
        chi = made.fit(how).chi
        signs = [np.sign(how.factor[c] * s.Y[:, k] * (s.W[c] @ chi)) for s in quick.samples]
        made = quick.of([_times(s, k, x) if mine else s for s, x, mine in zip(quick.samples, signs, its)])
    turned = quick.of([_times(s, k, -np.ones(len(s.t))) if x else s for s, x in zip(quick.samples, its)])
    return made if made.fit(how).gain_over(turned.fit(how)) > CLEARLY else None


def one_sided(samples: Sequence[Sample], k: int) -> bool:
    """Whether torque k goes beyond zero by no more than a filter makes of a sharp turn there."""
    low, high = (f(f(s.Y[:, k]) for s in samples) for f in (min, max))
    return bool(min(high, -low) < RAIL * (high - low))


def _times(s: Sample, k: int, sign: np.ndarray) -> Sample:
    """With torque k times signs (N,)."""
    Y, late = s.Y.copy(), s.late.copy()
    Y[:, k], late[:, :, k] = sign * Y[:, k], sign * late[:, :, k]
    return replace(s, Y=Y, late=late)


def remedy(asked: Asked, c: int) -> str:
    return f"record it with its sign, or leave it out with {asked.left_out([c])}"
