"""How low the positions of a joint that is slow for its encoder are filtered.

An encoder's steps are noise of its rate and more of its acceleration: at 40 mrad/s steps of 0.05 mrad make
five times the acceleration that a joint has below 40 Hz, and bias what is fitted to it. Which part of a
position is motion its rounding says itself (Morozov's discrepancy principle, Soviet Math. Dokl. 7, 1966): the
motion whose rounding was recorded lies within step^2 / 12 of it, mean square. A filter may take away no more
than that, in no stretch of the recording, and is as low as it may be where it takes away as much: what it
then loses of the motion is about what it passes of the steps, however little white these are. (Of robots at
20 to 100 mrad/s, steps of 0.05 and 0.2 mrad, the acceleration is so 0.3 to 2 % wrong, where it was 13 to 500
behind 10 and 40 Hz.) Positions that scatter by more than their steps are never that near a filtered one, and
stay as they are."""

from __future__ import annotations

import numpy as np

from ident.recordings.recording import RecordingStream, raw_blocks
from ident.signals.low_pass import LowPass, zero_phase

ALIKE = 0.99  # share of a position's changes that are whole steps
EXCERPT = 16000  # rows in which a step is looked for
STRETCHES = 64  # of an excerpt, of which those count that cross steps
SELDOM = 3.6  # standard deviations, beyond which one of so many goes in a hundredth of the recordings
TRANSIENTS = 20.0  # periods of the cut-off in a recording's stretch: its ends take a fifth of it at most
HALVINGS = 12  # of the range of a cut-off, in its logarithm


def resolution(x: np.ndarray) -> float:
    """Of a signal (N,): the least of its changes, but for what was put in; 0 of one that never changes."""
    steps = np.abs(np.diff(x))
    steps = steps[steps > 0]
    return float(np.quantile(steps, 0.02)) if len(steps) else 0.0


def in_steps(x: np.ndarray, step: float) -> bool:
    """Whether a signal (N,) moves in whole steps."""
    with np.errstate(over="ignore", invalid="ignore"):  # a logger's marks may be as large as numbers get
        multiples = (x - x[0]) / step
        return bool(np.mean(np.abs(multiples - np.rint(multiples)) < 1e-3) >= ALIKE)


def steps_of(stream: RecordingStream) -> np.ndarray:
    """(n,) steps in which a recording's positions move; 0 of those that do not."""
    n, begin, parts, rows = len(stream.need.joints), stream.survey.segments[0].move_start, [], 0
    for _, t, values in raw_blocks(stream):
        parts.append(values[t >= begin, :n])
        rows += len(parts[-1])
        if rows > EXCERPT:
            break
    every = [x[np.isfinite(x)] for x in np.concatenate(parts)[:EXCERPT].T]  # what is lost is masked later
    steps = np.array([resolution(x) for x in every])
    return np.array([step if step > 0 and in_steps(x, step) else 0.0 for x, step in zip(every, steps)])


def lowest_cutoff(q: np.ndarray, step: float, filter: LowPass, stretch_s: float) -> float:
    """Hz at which positions q (N,), as recorded in such steps, may be filtered, of `filter` in all else; inf
    where not below it. stretch_s: how long the recording's stretches are."""
    size = max(len(q) // STRETCHES, 8)
    whole = len(q) // size * size
    pieces = q[:whole].reshape(-1, size)
    crossing = np.ptp(pieces, axis=1) >= 2 * step
    low, high = np.log(TRANSIENTS / stretch_s), np.log(filter.cutoff_hz)
    if not (step > 0 and crossing.any()) or low >= high:
        return np.inf
    rounded = np.minimum(np.abs(np.diff(pieces)).sum(axis=1) / step, size)  # errors that are others
    most = step**2 / 12 * (1 + SELDOM * np.sqrt(0.8 / np.maximum(rounded, 1)))

    def may(cutoff_hz: float) -> bool:
        taken = q - zero_phase(q, filter.rate_hz, cutoff_hz, filter.order)
        squares = np.mean(taken[:whole].reshape(-1, size) ** 2, axis=1)
        return bool(np.all((squares <= most)[crossing]))

    if not may(filter.cutoff_hz):
        return np.inf
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if may(float(np.exp(middle))) else (middle, high)
    return float(np.exp(high))
