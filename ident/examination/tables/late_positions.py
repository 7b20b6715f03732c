"""A position that comes later or earlier than its logged velocity: no filter of a velocity makes it early.

A controller's velocity comes with its position or, filtered, a little later, on all joints alike. Of
stretches of a recording the lags at which the two go alike best are compared, joint by joint: their scatter
says how well a lag is known. (Of an AIRBOT whose fourth position came 12 rows late in one run the torques,
which are small there, said nothing.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.tables.signals import Columns

STRETCHES = 8
FEWEST = 4  # stretches in which a joint moves
FARTHEST_S, STEPS = 0.15, 15  # of the lags that are tried, and how many on each side
ALIKE = 0.9  # correlation from which two signals are the same
MOVED = 0.02  # rad or m
SURE = 5.0  # standard errors
# a median's standard error times sqrt(n) over the median deviation, of normal noise
OF_MEDIAN = 1.4826 * 1.2533
ROWS = 2.0  # at which a derivative and a logger's order may differ
CELL_ROWS = 25  # at most over which both are taken


@dataclass(frozen=True, slots=True)
class Lag:
    """How much later than the derivative of its position a velocity comes [s], its standard error, and the
    time between rows [s]."""

    s: float
    error_s: float
    row_s: float

    def differs(self, other: float = 0.0) -> bool:
        return abs(self.s - other) > SURE * self.error_s + ROWS * self.row_s


def lag_of(t: np.ndarray, q: np.ndarray, dq: np.ndarray) -> Lag | None:
    """Of one joint; t (N,) increasing. None where too little of its motion shows one."""
    good = np.isfinite(q) & np.isfinite(dq)
    t, q, dq = t[good], q[good], dq[good]
    if len(t) < 200 or np.ptp(q) < MOVED:
        return None
    row = float(np.median(np.diff(t)))
    parts = zip(np.array_split(t, STRETCHES), np.array_split(q, STRETCHES), np.array_split(dq, STRETCHES))
    every = [_best(its, position, velocity, row) for its, position, velocity in parts]
    lags = [lag for lag in every if lag is not None]
    if len(lags) < FEWEST:
        return None
    middle = float(np.median(lags))
    scatter = OF_MEDIAN * float(np.median(np.abs(np.array(lags) - middle)))
    return Lag(middle, scatter / np.sqrt(len(lags)), row)


def _best(t: np.ndarray, q: np.ndarray, dq: np.ndarray, row: float) -> float | None:
    """The lag [s] at which what both gain over cells goes alike best; None where no lag in reach makes them
    alike, or the joint rests, or rows are gone."""
    if np.ptp(q) < MOVED or np.diff(t).max() > 10 * row:
        return None
    total = np.concatenate([[0.0], np.cumsum(0.5 * (dq[1:] + dq[:-1]) * np.diff(t))])
    width = max(3, min(CELL_ROWS, len(t) // 50))
    step = max(1, int(FARTHEST_S / row / STEPS))
    most = step * min(STEPS, (len(t) - width) // (4 * step))
    if most == 0:
        return None
    at = np.arange(most, len(t) - width - most, max(1, width // 3))
    x, shifts = q[at + width] - q[at], np.arange(-most, most + 1, step)
    y = total[at + shifts[:, None] + width] - total[at + shifts[:, None]]
    r = (y @ x) / np.sqrt(np.maximum((x @ x) * (y**2).sum(axis=1), 1e-300))
    k = int(np.argmax(r))
    if r[k] < ALIKE or not 0 < k < len(r) - 1:
        return None
    bend = r[k - 1] - 2 * r[k] + r[k + 1]
    return float(row * (shifts[k] + step * 0.5 * (r[k - 1] - r[k + 1]) / bend)) if bend < 0 else None


def late_positions(columns: Columns, lags: Mapping[str, Lag]) -> Iterator[Check]:
    """lags: joint -> its velocity's. Joints of another lag than most, or all, where they lead."""
    usual = float(np.median([lag.s for lag in lags.values()])) if len(lags) > 2 else 0.0
    odd = {j: lag for j, lag in lags.items() if lag.differs(usual)}
    leading = {j: lag for j, lag in odd.items() if lag.s < usual and lag.differs()}
    behind = {j: lag for j, lag in odd.items() if lag.s > usual}
    most = [lags[j] for j in lags if j not in odd]
    of_others = f" (of the other joints by {_ms(most)})" if most else ""
    if leading:
        yield _late(columns, leading, of_others)
    elif not odd and usual < 0 and all(lag.differs() for lag in lags.values()):
        yield _late(columns, lags, "")
    if behind and most:
        yield _early(columns, behind, of_others)


def _late(columns: Columns, which: Mapping[str, Lag], others: str) -> Check:
    q, dq = (listed(f"{name}{j}" for j in which) for name in ("q", "dq"))
    are = "is" if len(which) == 1 else "are"
    return Check(
        "channel_delay",
        tuple(f"q{j}" for j in which),
        f"the derivative of {q} comes about {_ms(which.values())} after {dq}{others}: "
        f"{q} {are} logged late or filtered, or {dq} {are} what was commanded",
        "log positions and torques of one moment",
        recording=columns.recording,
        open=bool(others),
    )


def _early(columns: Columns, which: Mapping[str, Lag], others: str) -> Check:
    q, dq = (listed(f"{name}{j}" for j in which) for name in ("q", "dq"))
    come, are = ("comes", "is") if len(which) == 1 else ("come", "are")
    return Check(
        "channel_delay",
        tuple(f"dq{j}" for j in which),
        f"{dq} {come} about {_ms(which.values())} after the derivative of {q}{others}: {dq} {are} logged "
        f"late or filtered, which harms nothing here, or {q} {are} logged early, which does",
        f"look whether the torque of joint {listed(which)} fits its motion",
        recording=columns.recording,
    )


def _ms(lags: Iterable[Lag]) -> str:
    return f"{1e3 * abs(float(np.median([lag.s for lag in lags]))):.0f} ms"
