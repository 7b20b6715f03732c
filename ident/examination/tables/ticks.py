"""The ticks of a uniform clock on which stamps that scatter lie where rows are missing among them.

Rows cannot be counted there, but a stamp that scatters by less than half a tick says on which one its row
was taken. How long a tick is the rows tell by and by: of a stretch twice as long as the one before, the line
through that one foretells each place to far less than half a tick."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

FIRST = 64  # rows whose places are counted from one to the next
NEAR = 0.15  # of a tick, standard deviation: one row in a thousand is then nearer to another tick


@dataclass(frozen=True, slots=True)
class Ticks:
    """A uniform clock, and how far stamps leave its ticks."""

    start: float  # [s]
    step: float  # [s]
    worst_s: float
    rows: int
    missing: int  # ticks between the first and the last row without one

    def of(self, t: np.ndarray) -> np.ndarray:
        """The tick (N,) [s] next to each stamp (N,) [s]."""
        return np.asarray(self.start + self.step * np.rint((t - self.start) / self.step))


def ticks(
    stamps: Callable[[], Iterable[np.ndarray]], window: tuple[float, float] = (-np.inf, np.inf)
) -> Ticks | None:
    """The clock behind stamps [s] inside the window, where each row is near a tick of its own; None
    elsewhere. stamps: their blocks, read twice, however many there are."""
    line = _Line()
    for t in stamps():
        line.take(t[(t >= window[0]) & (t < window[1])])
    if line.rows < FIRST or not line.step > 0:
        return None
    start, step, squares, worst, shared, last = line.start, line.step, 0.0, 0.0, 0, -np.inf
    first = np.inf
    for t in stamps():
        its = (t[(t >= window[0]) & (t < window[1])] - start) / step
        if not len(its):
            continue
        place = np.rint(its)
        off = its - place
        squares, worst = squares + float(off @ off), max(worst, float(np.abs(off).max()))
        shared += int((np.diff(place, prepend=last) < 1).sum())
        first, last = min(first, place[0]), place[-1]
    if np.sqrt(squares / line.rows) > NEAR or shared > line.rows / 1000:
        return None
    return Ticks(start, step, worst * step, line.rows, int(last - first) + 1 - (line.rows - shared))


class _Line:
    """Stamps against the places of their rows, a straight line, by sums."""

    def __init__(self) -> None:
        self.rows, self.start, self.step = 0, 0.0, 0.0
        self._zero = 0.0  # the first stamp, that sums of ten hours stay exact
        self._sums = np.zeros(4)  # place, stamp, place^2, place x stamp

    def take(self, t: np.ndarray) -> None:
        if not self.rows and len(t) >= FIRST:
            self._zero = float(t[0])
            steps = np.diff(t[:FIRST])
            usual = float(np.median(steps))
            if not usual > 0:
                return
            places = np.concatenate([[0.0], np.cumsum(np.maximum(np.rint(steps / usual), 1.0))])
            for _ in range(3):  # to and fro until each row has the place that the line says
                self._sums, self.rows = np.zeros(4), 0
                self._add(places, t[:FIRST])
                places = self._places(t[:FIRST])
            t = t[FIRST:]
        while len(t) and self.rows:
            piece, t = t[: self.rows], t[self.rows :]
            self._add(self._places(piece), piece)

    def _places(self, t: np.ndarray) -> np.ndarray:
        return np.asarray(np.rint((t - self.start) / self.step))

    def _add(self, places: np.ndarray, t: np.ndarray) -> None:
        x = t - self._zero
        self.rows += len(t)
        self._sums += [places.sum(), x.sum(), places @ places, places @ x]
        p, s, pp, ps = self._sums / self.rows
        self.step = float((ps - p * s) / max(pp - p * p, 1e-300))
        self.start = float(self._zero + s - self.step * p)
