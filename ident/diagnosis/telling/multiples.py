"""Waves of one joint that are one shape: a tooth that is broken is no wave, and told as several."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil

import numpy as np

from ident.diagnosis.telling.findings import Finding
from ident.examination.check import listed

WAVES = "wavenumber"
WITHIN = 3.0  # standard deviations


def multiples(findings: Sequence[Finding], alpha: float) -> Iterator[str]:
    """A note where waves of the position of one joint go as often as one of them does, or two, three, ...
    times as often, but for chance at this rate: that all of them are as near to its multiples."""
    for joints in dict.fromkeys(f.joints for f in findings):
        mine = [f for f in findings if f.joints == joints and f.parameters.get(WAVES, {}).get("std")]
        if len(mine) < 2:
            continue
        k, sd = (np.array([float(f.parameters[WAVES][key]) for f in mine]) for key in ("value", "std"))
        first = int(np.argmin(k))
        times = np.rint(k / k[first])
        within = WITHIN * np.hypot(sd, times * sd[first])
        off, others = np.abs(k - times * k[first]), np.arange(len(k)) != first
        by_chance = np.minimum(2 * within / k[first], 1.0)[others].prod()
        if (off > within)[others].any() or by_chance > alpha:
            continue
        unit, digits = mine[0].parameters[WAVES]["unit"], max(1, ceil(-np.log10(sd[first])))
        waves = listed(f"{f.effect.replace('_', ' ')} at {n:g} times" for f, n in zip(mine, times))
        yield (
            f"joint {joints[0]}: one thing that repeats every {2 * np.pi / k[first]:.3g} "
            f"{unit.removeprefix('1/')} ({k[first]:.{digits}f} {unit}) and is no wave, as a tooth that is "
            f"damaged, rather than several: {waves} that"
        )
