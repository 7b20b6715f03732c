"""Columns that are no longer what was recorded: straight between a slower log's samples, or scaled for
learning.

What is measured lies on no line, has no mean of exactly nothing, and its largest values are no ones. (Of a
UR10e's positions of 5 Hz, interpolated to 94, 16 % were left for 5, and nothing was said; of a Franka whose
torques had their means taken off, a zero of one of them.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.repeats import HELD_ALIKE, HELD_ROWS, SAME, seldom
from ident.examination.tables.signals import MOVED, Columns
from ident.signals.resolution import in_steps
from ident.signals.runs import runs_of_equals

EXACTLY = 1e-6  # of its size, to which a number that was made is what it was to be, in single precision too
FEWEST = 2  # columns, of which chance makes none so
KNOT = 2.5  # rows about a slower log's sample, one or two, that are on no line
SOME = 0.25  # of the rows, which are on lines where hardly more than those are on none


def interpolated(columns: Columns, excerpt: Excerpt, slow: set[int]) -> Iterator[Check]:
    """Signals that bend only every so many rows, most of those in which they move; slow: held. But not by the
    same angle each time, as rates that hold do in steps, or where they are turned; and what turns over is
    straight but for its steps about the middle, and curved elsewhere. Elsewhere rounding hides bends. (Of a
    UR10e's positions of 20 Hz in coarse steps, interpolated to 50, one was told to be of 10 Hz by 60 bends in
    1767 rows.)"""
    found: dict[int, tuple[float, int]] = {}
    each = [_Piece.of(t, values) for _, t, values in excerpt.pieces if len(t) > 2 and (np.diff(t) > 0).all()]
    rows = sum(len(piece.t) for piece in each)
    for k in range(len(columns.signals)):
        x = excerpt.column(k)
        if k in slow or not np.ptp(x) > 0:
            continue
        least = SAME * float(np.ptp(x)) + 2 * _rounded_to(x)
        on = [piece.on_lines(k, least) for piece in each]
        if sum(int(np.count_nonzero(its)) for its in on) < SOME * rows:
            continue
        gaps, steps, bends, bent, moves = [], [], [], 0, 0
        for piece, its in zip(each, on):
            t, values = piece.t, piece.values
            begin, length = _runs(its)
            begin, length = begin[length > 1], length[length > 1]
            bent += len(t) - 2 - int(length.sum())
            gaps.append(np.diff(begin))
            slopes = (values[begin + length, k] - values[begin, k]) / (t[begin + length] - t[begin])
            bends.append(np.abs(np.diff(slopes)))
            steps.append(float(np.median(np.diff(t))))
            moves += int(np.count_nonzero(np.diff(values[:, k])))
        every = np.concatenate(gaps) if gaps else np.zeros(0)
        if len(every) < 10 or bent > KNOT * len(every):
            continue
        usual = float(np.median(every))
        bend = np.concatenate(bends)
        alike = np.abs(every - usual) <= max(1.0, 0.1 * usual)
        steadily = alike.mean() > HELD_ALIKE and every[alike].sum() > HELD_ALIKE * moves
        seconds = usual * float(np.median(steps))
        again = np.mean(np.abs(bend - np.median(bend)) <= 0.1 * np.median(bend) + least / seconds)
        if usual >= HELD_ROWS and seldom(seconds, columns) and steadily and not again > HELD_ALIKE:
            found[k] = seconds, int(usual)
    if found:
        names, (seconds, rows) = [columns.signals[k] for k in found], max(found.values())
        does = "goes straight and bends" if len(names) == 1 else "go straight and bend"
        yield Check(
            "held_signal",
            tuple(names),
            f"{listed(names)} {does} only every {rows} rows ({seconds:.3g} s): recorded at "
            f"{1 / seconds:.3g} Hz and interpolated, which leaves out what is faster",
            "record them at the rate of the others",
        )


def _rounded_to(x: np.ndarray) -> float:
    """The step of what is written with so many digits, or in single precision; 0 elsewhere."""
    steps = np.abs(np.diff(x))
    step = float(steps[steps > 0].min())
    if in_steps(x, step):
        return step
    return float(np.spacing(np.float32(np.abs(x).max()))) if (x.astype(np.float32) == x).all() else 0.0


@dataclass(frozen=True, slots=True)
class _Piece:
    """Rows of a table, t (N,), values (N, m), with what every column is asked with: weight (N - 2,) of the
    row before in a line through both neighbours, rate (N - 1,) of the stamps, and their rounding in s."""

    t: np.ndarray
    values: np.ndarray
    weight: np.ndarray
    rate: np.ndarray
    rounding: float

    @classmethod
    def of(cls, t: np.ndarray, values: np.ndarray) -> _Piece:
        step = np.diff(t)
        weight = step[1:] / (step[:-1] + step[1:])
        return cls(t, values, weight, 1.0 / step, float(np.spacing(np.abs(t).max())))

    def on_lines(self, k: int, least: float) -> np.ndarray:
        """(N - 2,) which rows of column k lie on the line through their neighbours."""
        x = self.values[:, k]
        bend = np.abs(x[1:-1] - x[2:] - (x[:-2] - x[2:]) * self.weight)
        fastest = float(np.abs(np.diff(x) * self.rate).max())
        return np.asarray(bend <= least + 4 * self.rounding * fastest)


def _runs(on: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Begin (K,) and length (K,) of the runs of rows that are."""
    begin, length = runs_of_equals(on)
    return begin[on[begin]], length[on[begin]]


def scaled(columns: Columns, excerpt: Excerpt) -> Iterator[Check]:
    """Columns of mean 0 and deviation 1, torques of mean 0, torques whose largest value is 1."""
    if excerpt.every > 1 or not excerpt.pieces:  # these are of the whole
        return
    moving = [k for k in range(len(columns.signals)) if np.ptp(excerpt.column(int(columns.joint[k]))) > MOVED]
    moving = [k for k in moving if np.ptp(excerpt.column(k)) > 0]
    each = {k: excerpt.column(k) for k in moving}
    centred = {k: abs(x.mean()) < EXACTLY * x.std() for k, x in each.items()}
    ones = [k for k, x in each.items() if centred[k] and _is_one(x.std(), len(x))]
    if len(ones) >= FEWEST:
        names = [columns.signals[k] for k in ones]
        yield Check(
            "scaled_columns",
            tuple(names),
            f"{listed(names)} have mean 0 and deviation 1 each, as nothing that is measured: they were "
            "standardised, and neither their units nor their zeros are known any more",
            "use the log from before that, or give each its scale and offset with columns:",
            outcome="refused",
        )
        return
    torques = [k for k in moving if k >= columns.n]
    least = max(FEWEST, len(torques) // 2 + 1)  # some of which a spike was taken from
    for which, words, what in (
        (
            [k for k in torques if centred[k]],
            "have mean 0 each, as nothing that is measured: their means were taken off, and what gravity and "
            "friction make of these is gone",
            "zeros",
        ),
        (
            [k for k in torques if abs(np.abs(each[k]).max() - 1) < EXACTLY],
            "are 1 each where they are largest: a limit of theirs, or they were scaled to that, and what "
            "they are to each other is gone",
            "scales",
        ),
    ):
        if len(which) >= least:
            yield _lost([columns.signals[k] for k in which], words, what)


def _lost(names: Sequence[str], words: str, what: str) -> Check:
    remedy = f"use the log from before that: without their {what} the torques mean little"
    return Check("scaled_columns", tuple(names), f"{listed(names)} {words}", remedy, hint=True, open=True)


def _is_one(deviation: float, rows: int) -> bool:
    """Of all rows, or of all but one, as some programs have it."""
    return bool(min(abs(deviation - 1), abs(deviation * np.sqrt(rows / max(rows - 1, 1)) - 1)) < EXACTLY)
