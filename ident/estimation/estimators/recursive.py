"""Recursive least squares with forgetting: what was recorded earlier weighs less.

    minimise  sum_w forgetting^(last - w) ||Y_w - W_w chi||^2,   w: windows of 15 min of each recording

in the order of the study's recordings: the estimate that summaries give window by window (summaries/solve.py:
recursive), here of rows, so that it carries the tests and deviations of any fit. One window is one weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.equations.observation import ChannelFactor, GrowingFactor, RecordingSystem

WINDOW_S = 900.0  # of a summary, too


def weights(systems: Sequence[RecordingSystem], forgetting: float) -> list[list[np.ndarray]]:
    """(m,) of each segment of each system, 1 in the last window."""
    ages: list[list[np.ndarray]] = []
    before = 0
    for system in systems:
        first = min(float(segment.t[0]) for segment in system.segments)
        numbers = [
            np.floor((segment.t - first) / WINDOW_S).astype(int) + before for segment in system.segments
        ]
        ages.append(numbers)
        before = max(int(number.max()) for number in numbers) + 1
    return [[forgetting ** (before - 1 - number) for number in numbers] for numbers in ages]


def windows(systems: Sequence[RecordingSystem]) -> int:
    """How many weights there are."""
    return len({float(x) for its in weights(systems, 0.5) for weight in its for x in weight})


def faded_factors(systems: Sequence[RecordingSystem], forgetting: float) -> tuple[ChannelFactor, ...]:
    """Factors of all recordings with their rows weighed; `rows` counts what the weights leave."""
    factors = [
        GrowingFactor(np.unique(np.concatenate([system.factors[j].columns for system in systems])))
        for j in range(len(systems[0].factors))
    ]
    left = np.zeros(len(factors))
    for system, its in zip(systems, weights(systems, forgetting)):
        for segment, weight in zip(system.segments, its):
            for span, piece in segment.pieces():
                root = np.sqrt(weight[span])
                for j, factor in enumerate(factors):
                    mine, used = system.channel == j, piece.used[j]
                    factor.add_entries(
                        system.column[mine], piece.values[mine] * root, piece.Y[j] * root, used
                    )
                    left[j] += float(np.sum(root[used] ** 2))
    return tuple(replace(f.factor(), rows=round(rows)) for f, rows in zip(factors, left))


def weighed(systems: Sequence[RecordingSystem], forgetting: float) -> tuple[RecordingSystem, ...]:
    """The same systems with each row of W times its weight: what the estimate's covariance is made of."""
    out = []
    for system, its in zip(systems, weights(systems, forgetting)):
        segments = tuple(
            replace(segment, values=np.asarray(segment.values[:]) * weight)
            for segment, weight in zip(system.segments, its)
        )
        out.append(replace(system, segments=segments))
    return tuple(out)
