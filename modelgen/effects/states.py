"""States of rate-independent effects, integrated over a whole record between reversals.

Both states depend on the path of q alone, and have a closed form while q is monotone, so a record of
N samples costs one vector expression per reversal and not one step per sample.
"""

from collections.abc import Iterator, Mapping

import numpy as np

Array = np.ndarray
FADE = 12.0  # of the exponent, after which a stretch of travel is summed anew
FULL = 40.0  # from which on 1 - exp(-x) is 1; what is smaller by far is slow to compute


def monotone_pieces(q: Array) -> Iterator[tuple[int, int, float]]:
    """(first, last, direction) of the stretches between reversals of q; last is the next first."""
    step = np.diff(q)
    moving = np.flatnonzero(step)
    if moving.size == 0:
        return
    direction = np.sign(step[moving])
    turns = np.flatnonzero(np.diff(direction)) + 1
    starts = np.concatenate(([0], moving[turns]))
    ends = np.concatenate((moving[turns], [len(q) - 1]))
    for first, last, sign in zip(starts, ends, direction[np.concatenate(([0], turns))]):
        yield int(first), int(last), float(sign)


def integrate_dahl(q: Array, theta: Mapping[str, float], initial: float = 0.0) -> Array:
    """z (N,) of Dahl's law dz/dq = (1 - z sign dq)/width, exact: z[k] = s + (z[k-1] - s) exp(-|step|/width).

    The recurrence is summed in stretches of travel whose decay is `FADE`; what is older than two of them is
    below exp(-2 FADE) and left out.
    """
    if not len(q):
        return np.zeros(0)
    step = np.diff(q, prepend=q[:1]) / theta["width"]
    size = np.abs(step)
    travelled = np.cumsum(size)
    first = np.flatnonzero(np.diff(np.floor(travelled / FADE), prepend=-1.0))
    last = np.append(first[1:], len(q)) - 1
    length, begin, end = last - first + 1, travelled[first], travelled[last]
    grown = np.exp(travelled - np.repeat(begin, length))
    own = -np.expm1(-np.minimum(size, FULL)) * np.sign(step)
    own[0] = initial
    summed = np.cumsum(own * grown)
    before = np.concatenate(([0.0], summed[last[:-1]]))
    ends = (summed[last] - before) / grown[last]  # of each stretch, without what came before it
    older = np.zeros(len(ends))
    older[1:] = ends[:-1]
    older[2:] += ends[:-2] * np.exp(end[:-2] - end[1:-1])
    carried = older * np.exp(np.concatenate(([0.0], end[:-1])) - begin)
    return np.asarray((summed + np.repeat(carried - before, length)) / grown)


def integrate_play(q: Array, theta: Mapping[str, float], initial: float = 0.0) -> Array:
    """z (N,) of the play operator: the motor's place in the gap, held by the flanks at +-1."""
    z = np.full(len(q), initial, dtype=float)
    for first, last, _ in monotone_pieces(q):
        moved = z[first] + 2.0 * (q[first + 1 : last + 1] - q[first]) / theta["travel"]
        z[first + 1 : last + 1] = np.clip(moved, -1.0, 1.0)
    return z
