"""States that go on from block to block: what a stateful effect keeps between two calls.

A memory is one dict that the caller keeps for one pass over the recordings. An effect puts there, under its
own key, the instants, the driving signal and the state of the last block; the next block begins from the
sample before its own first one. A gap or another recording begins relaxed, where the way to its first sample
does. Blocks may overlap.

Along which positions is the study's choice (`filter: path`), and a diagnosis takes the one that predicts
better: along those whose sign friction takes, filtered at four times the cut-off of the others, Dahl's
friction of an arm in an independent simulator was 3.40 N m, as it is, for 3.27; of measured robots, whose
torques are filtered, more was left (a UR10e's joint 4 5.2 % for 4.4, of a Kinova's joint 7 3.3 for 3.0).
Tried, and not taken: to begin slid in. Of an AIRBOT's joint 6 35 % were left for 23.
"""

from collections.abc import Callable, Hashable, Mapping, MutableMapping
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


def at_first(
    signals: Mapping[str, Array], integrate: Callable[[Array, float], Array], relaxed: float
) -> float:
    """A state at the first sample, relaxed where the way there begins. (Relaxed at the first sample that a
    filter's transients leave, one row of 370 was off by a quarter of a friction, and a Maxwell slip was told
    for Dahl's law.)"""
    before = signals.get("before")
    if before is None or not len(before):
        return relaxed
    return float(integrate(np.append(before, signals["q"][0]), relaxed)[-1])
