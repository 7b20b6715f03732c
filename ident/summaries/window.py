"""What is kept of 15 minutes of a recording, and how windows add up to the same bits in any order.

    R_ab = qr([R_a; R_b])    per channel; sums of products of residuals and of motion are added

A sum over windows is a fixed binary tree over them in the order of their names and times, whoever computed
them and whenever they arrive. Floating-point sums depend on their order; a fixed tree makes one process,
threads and a cluster agree in every bit, and its depth keeps rounding at the logarithm of the count.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ident.equations.observation import ChannelFactor, stack
from ident.errors import IdentError


class SummaryError(IdentError):
    """Summaries that cannot be read, or that do not belong together."""


@dataclass(frozen=True, slots=True)
class Window:
    """Sums over [start, stop) s of a recording (or over several windows: the first one's name and start).

    factors: of [W_j Y_j], one per channel; products, counts (C, lags): residual products at each lag, how
    many; seconds of motion; heat, speed, load (n,): sums over seconds of temperature proxy, |dq| and
    |tau|.
    """

    recording: str
    start: float
    stop: float
    factors: tuple[ChannelFactor, ...]
    products: np.ndarray
    counts: np.ndarray
    seconds: float
    heat: np.ndarray
    speed: np.ndarray
    load: np.ndarray

    @property
    def key(self) -> tuple[str, float]:
        return self.recording, self.start

    @property
    def rows(self) -> int:
        return sum(factor.rows for factor in self.factors)


def added(a: Window, b: Window) -> Window:
    """Two windows as one."""
    return Window(
        a.recording,
        a.start,
        max(a.stop, b.stop) if a.recording == b.recording else b.stop,
        stack([a, b]),  # type: ignore[list-item]
        a.products + b.products,
        a.counts + b.counts,
        a.seconds + b.seconds,
        a.heat + b.heat,
        a.speed + b.speed,
        a.load + b.load,
    )


def merged(windows: Sequence[Window]) -> Window:
    """The sum of windows, the same bits in whatever order they are given. Raises SummaryError for none, or
    for one that is there twice."""
    ordered = sorted(windows, key=lambda window: window.key)
    for a, b in itertools.pairwise(ordered):
        if a.key == b.key:
            raise SummaryError(f"{a.recording} at {a.start:g} s is there twice; give each recording once")
    if not ordered:
        raise SummaryError("there is no window to add up; give at least one summary")
    return _tree(ordered)


def _tree(ordered: Sequence[Window]) -> Window:
    if len(ordered) == 1:
        return ordered[0]
    half = 1 << ((len(ordered) - 1).bit_length() - 1)  # the largest power of two below
    return added(_tree(ordered[:half]), _tree(ordered[half:]))


def leave_one_out(windows: Sequence[Window]) -> Iterator[tuple[Window, Window]]:
    """(window, sum of all others) in order of their keys. Nothing is subtracted: a factor less one of its
    parts loses digits, sums of those before and those after do not. Raises SummaryError."""
    ordered = sorted(windows, key=lambda window: window.key)
    if len(ordered) < 2:
        raise SummaryError("leaving one out needs at least two windows; give more summaries")
    after: list[Window | None] = [None]
    for window in reversed(ordered[1:]):
        after.append(window if after[-1] is None else added(window, after[-1]))
    before: Window | None = None
    for window, rest in zip(ordered, reversed(after)):
        others = [part for part in (before, rest) if part is not None]
        yield window, others[0] if len(others) == 1 else added(*others)
        before = window if before is None else added(before, window)
