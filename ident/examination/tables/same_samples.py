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


def same_samples(streams: Sequence[RecordingStream]) -> Iterator[Check]:
    """A warning for the later one of every such pair, but for windows of one file that the study's own check
    tells."""
    for one, other in combinations(streams, 2):
        a, b = one.survey, other.survey
        if one.file == other.file or a.rows != b.rows or len(a.lowest) != len(b.lowest):
            continue
        if not (np.array_equal(a.lowest, b.lowest) and np.array_equal(a.highest, b.highest)):
            continue
        roles = "what judges is what was fitted" if one.role != other.role else "its rows count twice"
        yield Check(
            "same_rows",
            (),
            f"it holds the samples of {one.label} again: {roles}",
            "leave one of the two out",
            recording=other.label,
        )
