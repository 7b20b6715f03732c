"""What was found, held against structure that nobody has a name for and that does not carry over.

Beside what was found a function without a name may still say much on the fitted rows, its own size paid for,
and nothing on the judged ones: something is there that is no noise and that no law of these signals
describes. Then log E, which knows noise alone, overrates whatever leans on the same rows: within 13 s of a
Franka joint 6 was told to read 1.18 times too much, joint 5 by another split 0.86 times, by 27 nats each,
where such functions had 60 and 90 on the fitted rows. So they stay in the model as what they are, a Gaussian
process: of the fitted rows' own prior (nameless.py), with values of their own on the judged rows, as their
motion is none that the fitted ones have seen. What was found has to say more than the limit beside them, on
the rows that chose it and on those that judge it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ident.diagnosis.evidence import Columns, Metric, Side, orthonormal, weigh
from ident.diagnosis.nameless import Flexible
from ident.diagnosis.state import Found, State

Functions = Mapping[int, Flexible]  # of channels


def beside_nameless(others: State, f: Found, functions: Functions, tau: float) -> float:
    """What was found says beside functions of the channels that it says something of: log E [nats], minus
    infinity where the rows that chose it do not ask for it beside them, infinite where there are none, or
    where it is not the judged rows that show it. others: the state without it."""
    m = others.metric
    told = weigh(m, f.columns)
    near = {c: flex for c, flex in functions.items() if told.per_channel[c] > 0 or c in f.columns}
    if not near:
        return np.inf
    loud = told.rss / told.free
    rooms = m.whiten({c: flex.room for c, flex in near.items()})
    columns = m.whiten(f.columns)
    own, right = _left(m, m.fitted, columns, rooms, loud)
    sizes = np.linalg.lstsq(own, right, rcond=1e-9)[0]
    if 0.5 * float(right @ sizes) < tau:
        return -np.inf
    if told.log_e < tau:
        return np.inf
    own, right = _left(m, m.judged, columns, rooms, loud)
    fall = float(sizes @ right - 0.5 * sizes @ own @ sizes)
    rows = float(told.free[told.per_channel > 0].sum())
    return 0.5 * rows * float(np.log1p(max(2 * fall / max(rows, 1.0), -0.9)))  # of squares, as a likelihood


def _left(
    m: Metric, side: Side, columns: Columns, rooms: Columns, loud: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Products of whitened columns (p, p), and with the torque (p,), on the rows of a side: with the model's
    parameters free and the rooms' functions at their prior; loud: variance (C,) of the whitened noise."""
    p = next(iter(columns.values())).shape[1]
    first = {}
    end = m.B
    for c, room in rooms.items():
        first[c], end = end, end + room.shape[1]
    gram = np.zeros((end + p + 1, end + p + 1))
    for c, (places, values) in enumerate(m.X):
        on = side.mask & m.rows.use[c]
        at, parts = [places], [values[on]]
        if c in rooms:
            at.append(first[c] + np.arange(rooms[c].shape[1]))
            parts.append(rooms[c][on])
        if c in columns:
            at.append(end + np.arange(p))
            parts.append(columns[c][on])
        where = np.concatenate([*at, [end + p]])
        here = np.column_stack([*parts, m.y[c, on]])
        gram[np.ix_(where, where)] += here.T @ here / max(loud[c], 1e-300)
    gram[range(m.B, end), range(m.B, end)] += 1.0
    basis = orthonormal(gram[:end, :end])
    cross = basis.T @ gram[:end, end:]
    left = gram[end:, end:] - cross.T @ cross
    return left[:p, :p], left[:p, p]
