"""States that go on from block to block: what a stateful effect keeps between two calls.

A memory is one dict that the caller keeps for one pass over the recordings. An effect puts there, under its
own key, the instants, the driving signal and the state of the last block; the next block begins from the
sample before its own first one. A gap or another recording begins relaxed. Blocks may overlap.

Tried, and not taken: to integrate along the positions whose sign friction takes, filtered at four times the
cut-off of the others, and to begin slid in. Of an arm in an independent simulator, which was under way at its
first sample, Dahl's friction was then 3.40 N m, as it is, for 3.27, and no Maxwell slip said more than it. Of
measured robots, whose torques are filtered and which begin at rest, more was left: by the first of a UR10e's
joint 4 5.2 % for 4.4, of a Kinova's joint 7 3.3 for 3.0; by the second of an AIRBOT's joint 6 35 for 23, of a
TX40's joint 1 3.7 for 3.0.
"""

from collections.abc import Callable, Hashable, MutableMapping
from typing import Any

import numpy as np

Array = np.ndarray
Memory = MutableMapping[Hashable, Any]


def carried(
    memory: Memory | None,
    key: Hashable,
    recording: str,
    t: Array,
    drive: Array,
    integrate: Callable[[Array, float], Array],
    initial: float,
) -> Array:
    """(N,) state along `drive` (N,), from where the last block left it. `integrate(drive, first) ->
    state`."""
    before = None if memory is None else memory.get(key)
    z = None
    if before is not None and before[0] == recording and len(t):
        times, drives, states = before[1:]
        step = (t[-1] - t[0]) / (len(t) - 1) if len(t) > 1 else np.inf
        last = int(np.searchsorted(times, t[0] - 1e-9 * max(abs(t[0]), 1.0))) - 1
        if last >= 0 and t[0] - times[last] < 1.5 * step:
            z = integrate(np.concatenate(([drives[last]], drive)), float(states[last]))[1:]
    if z is None:
        z = integrate(drive, initial)
    if memory is not None:
        memory[key] = (recording, t, drive, z)
    return z
