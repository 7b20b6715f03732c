"""States of rate-independent effects, integrated over a whole record between reversals.

Both states depend on the path of q alone, and have a closed form while q is monotone, so a record of
N samples costs one vector expression per reversal and not one step per sample.
"""

from collections.abc import Mapping

import numpy as np

Array = np.ndarray
FADE = 12.0  # of the exponent, after which a stretch of travel is summed anew
FULL = 40.0  # from which on 1 - exp(-x) is 1; what is smaller by far is slow to compute


def reversals(q: Array) -> Array:
    """Samples at which q turns back, with the first."""
    step = np.diff(q)
    moving = np.flatnonzero(step)
    turned = np.flatnonzero(np.diff(np.sign(step[moving]))) + 1
    return np.concatenate(([0], moving[turned]))


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
    if len(q) < 2:
        return np.full(len(q), initial, dtype=float)
    first = reversals(q)
    last = np.append(first[1:], len(q) - 1)
    begin, z = [], initial
    for moved in (2.0 * (q[last] - q[first]) / theta["travel"]).tolist():
        begin.append(z)
        z = min(max(z + moved, -1.0), 1.0)
    base = np.repeat(np.stack([begin, q[first]]), last - first, axis=1)
    return np.append(initial, np.clip(base[0] + 2.0 * (q[1:] - base[1]) / theta["travel"], -1.0, 1.0))
