"""A stretch of a recording in which a channel of which nothing was said is wrong by far more than in the rest
of it, smoothly: something happened there, or it alone shows what the model lacks.

Its error there is `FAR_OFF` times that of the usual block. That is no slow noise: whitened by the noise of
all other rows it is louder than chance makes the loudest stretch. Nor is it noise that is loud for a while,
which would be as white as the rest: the past of what is left there foretells most of it. Rows that see their
joint turn round are left out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.special

from ident.diagnosis.evidence.blocks import block_numbers
from ident.diagnosis.evidence.state import State
from ident.diagnosis.evidence.sufficiency import FORETOLD
from ident.diagnosis.rows.whitened import news, whitener

BY_CHANCE = 1e-3  # that the loudest of a channel's blocks is so loud; of many channels it is none
FAR_OFF = 3.0  # times the error of the usual block
LEAST = 8  # blocks of a recording, to know the usual one by


@dataclass(frozen=True, slots=True)
class Stretch:
    """From start to stop [s since its begin] of a recording: the channels that are loud there, and of each
    the sums of squares of what is left there beyond the usual, and of all that is left of it."""

    recording: str
    start: float
    stop: float
    parts: Mapping[int, tuple[float, float]]

    def of(self, channels: Collection[int]) -> float:
        """The share of what is left of channels."""
        beyond, whole = zip(*(self.parts[c] for c in channels))
        return sum(beyond) / sum(whole)


def loud_stretches(state: State, quiet: Collection[int], away: np.ndarray) -> list[Stretch]:
    """Of the fitted rows of channels `quiet`, of which nothing was said; those that are loud at one time
    together. away (C, M): rows in which their joint keeps its direction. (What parameters that have taken up
    such a stretch do to the rows that judge is nothing that happened there.)"""
    found: list[Stretch] = []
    for c in quiet:
        for r in range(len(state.rows.names)):
            loud = _loud(state, c, away[c] & state.rows.fitted & (state.rows.recording == r))
            if loud is not None:
                found.append(loud)
    out: list[Stretch] = []
    while found:
        first = max(found, key=lambda its: its.of(its.parts))
        together = [its for its in found if _overlap(its, first)]
        found = [its for its in found if its not in together]
        start, stop = min(its.start for its in together), max(its.stop for its in together)
        parts = {c: part for its in together for c, part in its.parts.items()}
        out.append(Stretch(first.recording, start, stop, parts))
    return out


def _overlap(one: Stretch, other: Stretch) -> bool:
    return one.recording == other.recording and one.start < other.stop and one.stop > other.start


def _loud(state: State, c: int, here: np.ndarray) -> Stretch | None:
    """The loudest blocks in a row of a recording's rows `here` (M,); None where none is loud."""
    if not here.any():
        return None
    rows, residual = state.rows, state.residual[c]
    square = residual**2
    block, kept = block_numbers(rows, here)
    if kept.sum() < LEAST:
        return None
    power = np.bincount(block, square[here]) / np.bincount(block)
    loud = kept & (power > FAR_OFF**2 * np.median(power[kept]))
    if not loud.any() or loud.sum() > kept.sum() / 2:
        return None
    first = last = int(np.argmax(np.where(loud, power, 0.0)))
    while first > 0 and loud[first - 1]:
        first -= 1
    while last + 1 < len(loud) and loud[last + 1]:
        last += 1
    inside = np.zeros(len(here), bool)
    inside[here] = (block >= first) & (block <= last)
    if news(rows, residual, inside) > FORETOLD * float(np.mean(square[inside])):
        return None
    rest = state.rows.fitted & rows.use[c] & ~inside
    new = (whitener(rows, residual, rest, rows.use[c]) @ residual) ** 2
    rare = BY_CHANCE / kept.sum() ** 2  # so many stretches there are
    chance = scipy.special.fdtri(inside.sum(), rest.sum(), 1 - rare)
    if np.mean(new[inside]) < chance * np.mean(new[rest]):
        return None
    beyond = float(square[inside].sum() - inside.sum() * np.mean(square[here & ~inside]))
    if beyond <= 0:
        return None
    recording = rows.names[int(rows.recording[inside][0])]
    t, every = rows.t[inside] - state.begins(recording), float(square[rows.fitted & rows.use[c]].sum())
    return Stretch(recording, float(t[0]), float(t[-1] + rows.hop), {c: (beyond, every)})
