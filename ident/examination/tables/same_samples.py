"""Recordings that hold the same samples: a file copied under another name, or logged anew from a buffer.

Rows, and the least and the largest value of every signal to the last digit: two motions have them in common
in no log, not even repeated ones. (A UR10e's run that was fitted and, copied, judged: nothing was said, and
hysteresis of its sixth joint was told, which the other recordings do not show.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from ident.examination.check import Check
from ident.recordings.recording import RecordingStream
from ident.recordings.study import ROLES


def _pairs(streams: Sequence[RecordingStream]) -> Iterator[tuple[RecordingStream, RecordingStream]]:
    """But for windows of one file, which the study's own check tells."""
    for one, other in combinations(streams, 2):
        a, b = one.survey, other.survey
        if one.file == other.file or a.rows != b.rows or len(a.lowest) != len(b.lowest):
            continue
        if np.array_equal(a.lowest, b.lowest) and np.array_equal(a.highest, b.highest):
            yield one, other


def fitted_twice(streams: Sequence[RecordingStream]) -> list[tuple[RecordingStream, Check]]:
    """Fitted recordings that another one before holds, with the same load: without them the fit is the same,
    and its rows are as many as there are. (Of a Franka's three seconds, given twice, there were enough rows
    for its parameters, and 64 % were left.)"""
    out: list[tuple[RecordingStream, Check]] = []
    for one, other in _pairs(streams):
        known = any(other is its for its, _ in out)
        if one.role == other.role == "identify" and one.payload == other.payload and not known:
            said = f"it holds the samples of {one.label} again; left out"
            out.append((other, Check("same_rows", (), said, "", "mended", other.label)))
    return out


def same_samples(streams: Sequence[RecordingStream]) -> Iterator[Check]:
    """A warning for the later one of every such pair that is read, in the order of their roles."""
    for one, other in _pairs(sorted(streams, key=lambda stream: ROLES.index(stream.role))):
        judging = (
            "what judges is what was fitted" if one.role == "identify" else "what tests is what validates"
        )
        roles = judging if one.role != other.role else "its rows count twice"
        yield Check(
            "same_rows",
            (),
            f"it holds the samples of {one.label} again: {roles}",
            "leave one of the two out",
            recording=other.label,
        )
