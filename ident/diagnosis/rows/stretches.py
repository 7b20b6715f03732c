"""Which rows of long recordings the diagnosis looks at: stretches spread over them, and those that stand out.

A side (what is fitted, what judges) takes at most `rows` rows. They are cut from all its recordings laid end
to end, in stretches of STRETCH_S, shorter where there are more recordings than such stretches. What happens
once in an hour would fall between them: blocks in which the rigid fit leaves more than chance leaves in the
loudest of them, at the scatter of all, are looked at too (at most a third of the rows).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy.stats

from ident.equations.fine import Cut
from ident.equations.observation import DecimatedSegment, RecordingSystem

STRETCH_S = 20.0  # s
SHORTEST_S = 4.0  # s, of several noise memories
BLOCK_S = 2.0  # s whose residuals are compared
LOUD = 1 / 3  # of the rows, at most
EDGE = 3  # rows: what the decimation's response reaches beyond a stretch
CHANCE = 1e-3  # that the loudest of all blocks is taken for more


def cuts(
    systems: Sequence[RecordingSystem], rows: int, residuals: Callable[[], Sequence[Sequence[np.ndarray]]]
) -> tuple[Cut, ...]:
    """What is kept, in the order of the systems. residuals()[system][segment] (C, m) of a rigid fit."""
    out: list[Cut] = []
    rho: Sequence[Sequence[np.ndarray]] | None = None
    for role in dict.fromkeys(system.role for system in systems):
        mine = [
            (k, s, segment)
            for k, system in enumerate(systems)
            if system.role == role
            for s, segment in enumerate(system.segments)
        ]
        if sum(len(segment.t) for _, _, segment in mine) > rows and rho is None:
            rho = residuals()
        out += _of_a_role(mine, rows, rho)
    return tuple(sorted(out, key=lambda cut: (cut.system, cut.segment, cut.start)))


def _of_a_role(
    mine: Sequence[tuple[int, int, DecimatedSegment]],
    rows: int,
    residuals: Sequence[Sequence[np.ndarray]] | None,
) -> list[Cut]:
    lengths = [len(segment.t) for _, _, segment in mine]
    total = sum(lengths)
    if total <= rows:
        return [Cut(k, s, 0, length) for (k, s, _), length in zip(mine, lengths)]
    hop = float(np.median(np.concatenate([np.diff(segment.t[:2000]) for _, _, segment in mine])))
    loud = _loud(mine, [residuals[k][s] for k, s, _ in mine], hop, int(LOUD * rows)) if residuals else []
    left = rows - sum(cut.stop - cut.start for cut in loud)
    seconds = min(max(left * hop / len(mine), SHORTEST_S), STRETCH_S)
    length = max(8, round(seconds / hop))
    number = max(1, left // length)
    ends = np.cumsum(lengths)
    even = []
    for at in (np.arange(number) + 0.5) * total / number:  # in the middle of equal shares
        which = int(np.searchsorted(ends, at, side="right"))
        k, s, _ = mine[which]
        begin = int(
            np.clip(at - ends[which] + lengths[which] - length / 2, 0, max(lengths[which] - length, 0))
        )
        even.append(Cut(k, s, begin, min(begin + length, lengths[which])))
    return _joined([*loud, *even])


def _loud(
    mine: Sequence[tuple[int, int, DecimatedSegment]], rho: Sequence[np.ndarray], hop: float, most: int
) -> list[Cut]:
    """A stretch about each block whose median row is unusually large (a reversal's few rows are not), loudest
    first, at most `most` rows of them."""
    size, length = max(4, round(BLOCK_S / hop)), max(8, round(STRETCH_S / hop))
    where: list[tuple[int, int]] = []
    level: list[np.ndarray] = []
    for number, ((_, _, segment), left) in enumerate(zip(mine, rho)):
        starts = np.arange(0, len(segment.t) - size + 1, size)
        if not len(starts):
            continue
        whole = slice(0, len(starts) * size)
        shape = (len(left), len(starts), size)
        rows = np.where(segment.used, np.abs(left), np.nan)[:, whole].reshape(shape)
        enough = np.isfinite(rows).sum(axis=2) > 0.3 * size
        level.append(np.where(enough, np.nanmedian(np.where(enough[..., None], rows, 0.0), axis=2), np.nan))
        where += [(number, int(a)) for a in starts]
    if len(where) < 20:
        return []
    size_of = np.log(np.maximum(np.hstack(level), 1e-300))
    size_of -= np.nanmedian(size_of, axis=1, keepdims=True)
    spread = 1.4826 * np.nanmedian(np.abs(size_of), axis=1, keepdims=True)
    limit = scipy.stats.norm.isf(CHANCE / size_of.size)
    above = np.nan_to_num(size_of / np.maximum(spread, 0.1), nan=0.0).max(axis=0)
    out: list[Cut] = []
    taken: set[tuple[int, int]] = set()
    for block in np.argsort(-above):
        number, start = where[block]
        near = (number, start // length)
        if above[block] < limit or (len(out) + 1) * length > most:
            break
        if near in taken:
            continue
        taken.add(near)
        k, s, segment = mine[number]
        begin = max(0, min(start + size // 2 - length // 2, len(segment.t) - length))
        out.append(Cut(k, s, begin, min(begin + length, len(segment.t))))
    return out


def _joined(found: Sequence[Cut]) -> list[Cut]:
    """Those that overlap or touch, as one."""
    out: list[Cut] = []
    for cut in sorted(found, key=lambda c: (c.system, c.segment, c.start)):
        last = out[-1] if out else None
        if last and (last.system, last.segment) == (cut.system, cut.segment) and cut.start <= last.stop:
            out[-1] = replace(last, stop=max(last.stop, cut.stop))
        else:
            out.append(cut)
    return out


def cut_out(system: RecordingSystem, mine: Sequence[Cut]) -> RecordingSystem:
    """The system with these rows of its segments alone, one segment a cut. Rows at an edge that is none of
    the recording do not count: columns made of the stretch alone have not what lies beyond it."""
    parts = []
    for cut in mine:
        segment, rows = system.segments[cut.segment], slice(cut.start, cut.stop)
        weight = segment.weight[:, rows].copy()
        weight[:, : EDGE if cut.start else 0] = 0.0
        if cut.stop < len(segment.t):
            weight[:, -EDGE:] = 0.0
        values = np.array(segment.values[:, rows], float)
        parts.append(
            replace(
                segment, t=segment.t[rows].copy(), values=values, Y=segment.Y[:, rows].copy(), weight=weight
            )
        )
    return replace(system, segments=tuple(parts))
