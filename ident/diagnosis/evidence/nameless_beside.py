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

from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.metric import Columns, Metric, Side, orthonormal
from ident.diagnosis.evidence.nameless import Flexible
from ident.diagnosis.evidence.state import Found, State

Functions = Mapping[int, Flexible]  # of channels


def beside_nameless(others: State, f: Found, functions: Functions, tau: float) -> float:
    """What was found says beside functions of the channels that it says something of: log E [nats], minus
    infinity where the rows that chose it do not ask for it beside them, infinite where there are none, or
    where it is not the judged rows that show it. others: the state without it."""
    m = others.metric
    told = weigh(m, f.columns)
    near = leaned_on(f, told, functions)
    if not near:
        return np.inf
    loud = told.rss / told.free
    rooms = m.whiten({c: flex.room for c, flex in near.items()})
    columns = m.whiten(f.columns)
    fitted, judged = (_products(m, side, columns, rooms, loud) for side in (m.fitted, m.judged))
    own, right = _model_taken(fitted, m.B)
    sizes = np.linalg.lstsq(own, right, rcond=1e-9)[0]
    if 0.5 * float(right @ sizes) < tau:
        return -np.inf
    if told.log_e < tau:
        return np.inf
    alone = _fall(judged, m.B, sizes)
    given = _fall(fitted + judged, m.B, sizes) - _fall(fitted, m.B, sizes)
    rows = max(float(told.free[told.per_channel > 0].sum()), 1.0)
    return (
        0.5 * rows * float(np.log1p(max(2 * max(alone, given) / rows, -0.9)))
    )  # of squares, as a likelihood


def leaned_on(f: Found, told: Evidence, functions: Functions) -> Functions:
    """The functions of channels that what was found acts in, or says something of."""
    return {c: flex for c, flex in functions.items() if told.per_channel[c] > 0 or c in f.columns}


def _products(m: Metric, side: Side, columns: Columns, rooms: Columns, loud: np.ndarray) -> np.ndarray:
    """Products of the model's columns (the first m.B), whitened columns (p) and the torque on the rows of a
    side, the rooms' functions taken up by their prior; loud: variance (C,) of the whitened noise."""
    p = next(iter(columns.values())).shape[1]
    B, end = m.B, m.B + p + 1
    out = np.zeros((end, end))
    for c, (places, values) in enumerate(m.X):
        on = side.mask & m.rows.use[c]
        at, parts = [places], [values[on]]
        if c in columns:
            at.append(B + np.arange(p))
            parts.append(columns[c][on])
        where = np.concatenate([*at, [end - 1]])
        here = np.column_stack([*parts, m.y[c, on]]) / np.sqrt(max(loud[c], 1e-300))
        products = here.T @ here
        if c in rooms:
            room = rooms[c][on] / np.sqrt(max(loud[c], 1e-300))
            taken = np.linalg.cholesky(room.T @ room + np.eye(room.shape[1]))
            across = np.linalg.solve(taken, room.T @ here)
            products -= across.T @ across
        out[np.ix_(where, where)] += products
    return out


def _model_taken(products: np.ndarray, B: int) -> tuple[np.ndarray, np.ndarray]:
    """Of the columns (p, p), and with the torque (p,), the model's parameters free."""
    basis = orthonormal(products[:B, :B])
    across = basis.T @ products[:B, B:]
    left = products[B:, B:] - across.T @ across
    return left[:-1, :-1], left[:-1, -1]


def _fall(products: np.ndarray, B: int, sizes: np.ndarray) -> float:
    """Half the fall of the sum of squares by columns at these sizes."""
    own, right = _model_taken(products, B)
    return float(sizes @ right - 0.5 * sizes @ own @ sizes)
