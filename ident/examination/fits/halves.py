"""Whether a cause explains more of either half of the recordings, and of the other, which did not fit it.

What is wrong with a signal is wrong in all rows. What a fit of few rows makes of noise, or of something else
that the model lacks, is another thing in each half. (Of four seconds of an LWR4+ whose torques were all late
the fifth joint was told to turn the other way, of six clean ones of a KR 300 at 40 Hz the third.)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ident.examination.fits.quick import Assignment, Normal, Quick, added, solve
from ident.examination.fits.samples import Sample

PARTS = 4  # of every recording


def of_either_half(before: Quick, how: Assignment, other: Quick, its: Assignment) -> bool:
    """Whether recordings taken otherwise (other, its) are explained, and foretold, better in each half."""
    return all(gain > 0 for half in by_halves(before, how, other, its) for gain in half)


def by_halves(
    before: Quick, how: Assignment, other: Quick, its: Assignment, parts: int = PARTS, c: int | None = None
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Gains of either half, fitted, and of the other one, which that fit foretells; of torque c alone."""
    one, two = _halves(before, parts), _halves(other, parts)

    def gains(k: int) -> tuple[float, float]:
        plain, taken = (solve(x[k], x[1 - k], way) for x, way in ((one, how), (two, its)))
        if c is not None:
            plain, taken = (x.of_channel(c) for x in (plain, taken))
        return taken.gain_over(plain), taken.holds_over(plain)

    return gains(0), gains(1)


def _halves(quick: Quick, parts: int) -> list[Normal]:
    return [added([Normal.of(s) for s in half]) for half in halves_of(quick.samples, parts)]


def halves_of(samples: Sequence[Sample], parts: int = PARTS) -> tuple[list[Sample], list[Sample]]:
    """Parts of these recordings, in turn of one half and the other."""
    its = [s.rows(rows) for s in samples for rows in np.array_split(np.arange(len(s.t)), parts)]
    return its[::2], its[1::2]
