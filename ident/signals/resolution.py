"""How low the positions of a joint that is read in steps are filtered.

An encoder's steps are noise of its rate and more of its acceleration: at 40 mrad/s steps of 0.05 mrad make
five times the acceleration that a joint has below 40 Hz, and bias what is fitted to it. Which part of a
position is motion its rounding says itself: a motion that is known well enough, rounded again, has errors
like those that were recorded, whatever their colour. What a filter passes of these is noise of its positions;
what it takes from the recording beyond what it takes from them is motion that it loses. The cut-off is that
with the least of both together (the unbiased estimate of a risk: C. Stein, Annals of Statistics 9, 1981, with
the errors made and not taken as white). Of 29 joints of clean robots at 0.06 to 1.2 rad/s, 50 to 1,000 Hz, in
steps of 0.005 to 0.36 mrad, the acceleration is so within a quarter of the best that any cut-off gives, with
four exceptions of 1.4 to 1.7 times that (`benchmarks/false_findings.py` made them: 1564 to 1571, 1511, 1515
and 1539).

The motion that is known well enough: the lowest filter that takes away no more than rounding does, in no
stretch of the recording (Morozov's discrepancy principle, Soviet Math. Dokl. 7, 1966). Its own positions lose
about as much as a step hides, at the turns of a motion that stops. Positions that scatter by more than
their steps are never that near a filtered one, and stay as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ident.recordings.recording import RecordingStream, raw_blocks
from ident.signals.low_pass import LowPass, through, zero_phase

ALIKE = 0.99  # share of a position's changes that are whole steps
EXCERPT = 16000  # rows in which a step is looked for
STRETCHES = 64  # of an excerpt, of which those count that cross steps
SELDOM = 3.6  # standard deviations, beyond which one of so many goes in a hundredth of the recordings
TRANSIENTS = 20.0  # periods of the cut-off in a recording's stretch: its ends take a fifth of it at most
HALVINGS = 12  # of the range of a cut-off, in its logarithm
STEPS = 1.25  # from one cut-off that is tried to the next


def resolution(x: np.ndarray) -> float:
    """Of a signal (N,): the least of its changes, but for what was put in; 0 of one that never changes."""
    steps = np.abs(np.diff(x))
    steps = steps[steps > 0]
    return float(np.quantile(steps, 0.02)) if len(steps) else 0.0


def in_steps(x: np.ndarray, step: float) -> bool:
    """Whether a signal (N,) moves in whole steps, but for a few, as where a turn was taken out. (Of a UR10e
    whose first position wraps, in steps of which a turn holds no whole number, 7 % were left for 5.)"""
    with np.errstate(over="ignore", invalid="ignore"):  # a logger's marks may be as large as numbers get
        multiples = np.diff(x) / step
        multiples = multiples[multiples != 0]
        whole = np.abs(multiples - np.rint(multiples)) < 1e-3
        return bool(len(whole) and whole.mean() >= ALIKE)


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


def best_cutoff(q: np.ndarray, step: float, filter: LowPass, stretch_s: float) -> float:
    """Hz behind which positions q (N,), as recorded in such steps, are known best, of `filter` in all else;
    inf where that is not below its cut-off. stretch_s: how long the recording's stretches are."""
    known = lowest_cutoff(q, step, filter, stretch_s)
    if not np.isfinite(known):
        return np.inf
    motion = zero_phase(q, filter.rate_hz, known, filter.order)
    rounding = step * np.rint((motion - q[0]) / step) + q[0] - motion
    edge = _edge(q, step, replace(filter, cutoff_hz=known))
    hz = known * STEPS ** np.arange(int(np.log(filter.cutoff_hz / known) / np.log(STEPS)) + 1)
    filters = [replace(filter, cutoff_hz=its) for its in hz]
    both, inner = np.stack([q, rounding], axis=1), slice(edge, len(q) - edge)
    errors = [_errors(both[inner], passed[inner]) for passed in through(both, filters)]
    best = _lowest(hz, np.stack(errors))
    return best if best < hz[-1] else np.inf


def _lowest(hz: np.ndarray, errors: np.ndarray) -> float:
    """The lowest of cut-offs (F,) whose errors (F, N) are the least but for chance: within a standard
    deviation of their differences, stretch by stretch. (Of few steps crossed the least alone was ten times
    too high.)"""
    size = max(errors.shape[1] // STRETCHES, 1)
    sums = np.add.reduceat(errors, np.arange(0, errors.shape[1], size), axis=1)
    more = sums - sums[sums.sum(axis=1).argmin()]
    return float(hz[np.argmax(more.sum(axis=1) <= np.sqrt(np.sum(more**2, axis=1)))])


def _errors(both: np.ndarray, passed: np.ndarray) -> np.ndarray:
    """(N,) squares of what a filter loses of a motion and of what it passes of its rounding: both (N, 2)
    positions as recorded and errors like those of their rounding, passed (N, 2) these behind the filter."""
    taken = both - passed
    return np.asarray(taken[:, 0] ** 2 - taken[:, 1] ** 2 + passed[:, 1] ** 2)


def _edge(q: np.ndarray, step: float, filter: LowPass) -> int:
    """Samples at an end of positions q (N,) that their continuation, which nobody knows, moves by a step."""
    return filter.moved(step / max(float(np.ptp(q)), step))


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
    begin = np.arange(0, whole, size)

    def may(cutoff_hz: float) -> bool:
        edge = _edge(q, step, replace(filter, cutoff_hz=cutoff_hz))
        asked = crossing & (begin >= edge) & (begin + size <= len(q) - edge)
        taken = q - zero_phase(q, filter.rate_hz, cutoff_hz, filter.order)
        squares = np.mean(taken[:whole].reshape(-1, size) ** 2, axis=1)
        return bool(asked.any() and np.all((squares <= most)[asked]))

    if not may(filter.cutoff_hz):
        return np.inf
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if may(float(np.exp(middle))) else (middle, high)
    return float(np.exp(high))
