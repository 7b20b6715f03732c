"""States of rate-independent effects, integrated over a whole record between reversals.

Both states depend on the path of q alone, and have a closed form while q is monotone, so a record of
N samples costs one vector expression per reversal and not one step per sample.
"""

from collections.abc import Iterator, Mapping

import numpy as np

Array = np.ndarray


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
    """z (N,) of Dahl's law dz/dq = (1 - z sign dq)/width, exact: s + (z0 - s) exp(-|q - q0|/width)."""
    z = np.full(len(q), initial, dtype=float)
    for first, last, sign in monotone_pieces(q):
        travelled = np.abs(q[first + 1 : last + 1] - q[first])
        z[first + 1 : last + 1] = sign + (z[first] - sign) * np.exp(-travelled / theta["width"])
    return z


def integrate_play(q: Array, theta: Mapping[str, float], initial: float = 0.0) -> Array:
    """z (N,) of the play operator: the motor's place in the gap, held by the flanks at +-1."""
    z = np.full(len(q), initial, dtype=float)
    for first, last, _ in monotone_pieces(q):
        moved = z[first] + 2.0 * (q[first + 1 : last + 1] - q[first]) / theta["travel"]
        z[first + 1 : last + 1] = np.clip(moved, -1.0, 1.0)
    return z
