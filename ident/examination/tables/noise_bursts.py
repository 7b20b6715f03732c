"""A torque that is noise for a while, by more than all it does besides.

What a joint asks for goes on from row to row: of the third differences of few rows the median is noise alone,
whatever moves, and so is what is left of a cubic, where it moves slowly for them; no spike and no step moves
either. Noise that is larger there than the torque's own deviation drowns it. (Of an AIRBOT and a UR10e, one
of whose torques had bursts of two deviations, 18 and 25 % were left for 5, and nothing was said. A KR 300's
first torque shakes by a third of it from one row to the next where it turns.)
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from ident.examination.check import Check
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.signals import Columns
from ident.signals.runs import runs_of

ROWS = 32  # in which noise is measured
NORMAL = 0.6745  # median of the size of a normal deviate
AS_USUAL = 5.0  # times the usual noise, which a drive that works harder does not reach
MOST = 0.5  # of all rows: beyond, it is noise throughout
_BASIS = np.linalg.qr(np.vander(np.linspace(-1, 1, ROWS), 4))[0]
CUBIC = _BASIS @ _BASIS.T  # (ROWS, ROWS) the cubic through so many rows


def noise_bursts(columns: Columns, excerpt: Excerpt, others: Collection[int]) -> Iterator[Check]:
    """Of every torque but others, which are told to be held or coarse."""
    several = len(columns.signals) > columns.n + 1
    for k in range(columns.n, len(columns.signals)):
        usual = float(np.std(excerpt.column(k)))
        windows = [_windows(its[0], its[2][:, k]) for its in excerpt.pieces]
        rows, sizes = (np.concatenate(its) for its in zip(*windows, strict=True))
        if k in others or not usual > 0 or not len(rows):
            continue
        loud = sizes > max(usual, AS_USUAL * float(np.median(sizes)))
        runs = np.array([run for run in runs_of(loud) if run[1] - run[0] > 1])  # one may hold a transient
        if not len(runs) or loud.mean() > MOST:
            continue
        first, last = rows[runs[0, 0]], rows[runs[0, 1] - 1] + ROWS - 1
        times = f" and {len(runs) - 1} more times" if len(runs) > 2 else " and once more" * (len(runs) - 1)
        name = columns.signals[k]
        yield Check(
            "noise_burst",
            (name,),
            f"{name} is noise for a while (rows {first} to {last}{times}, {100 * loud.mean():.2g} % of all): "
            f"about {np.median(sizes[loud]):.3g} there, where all that it does deviates by {usual:.3g}, and "
            f"{np.median(sizes[~loud]):.2g} elsewhere: a cable, a plug, a disturbance",
            "leave that out with from: and to:" + f", or the torque with {columns.without([name])}" * several,
            rows=(int(first), int(rows[runs[-1, 1] - 1]) + ROWS - 1),
            hint=True,
            open=True,
        )


def _windows(rows: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(K,) first row (from 1) and deviation of noise of each so many rows of a torque (N,)."""
    count = len(x) // ROWS
    own = x[: count * ROWS].reshape(count, ROWS)
    ways = np.diff(own, 3, axis=1) / np.sqrt(20.0), own - own @ CUBIC
    sizes = np.min([np.median(np.abs(way), axis=1) for way in ways], axis=0) / NORMAL
    return rows[: count * ROWS : ROWS] + 1, sizes
