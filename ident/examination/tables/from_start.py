"""Positions that begin at exactly nothing in every recording: an encoder without an index counts from there.

A simulated arm does stand at the zeros of all its joints to the last count, again and again, so that it is
said only where something is odd that nothing else tells. (Of a UR10e whose positions count from the start of
each run a load, a zero or another robot was told, or nothing.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ident.examination.check import Check
from ident.examination.tables.signals import MOVED
from ident.recordings.recording import RecordingStream

FEWEST = 2  # joints of a recording, and recordings


def from_start(streams: Sequence[RecordingStream]) -> Iterator[Check]:
    """Said of all recordings together, or not at all."""
    files = {stream.file: stream for stream in streams}
    if len(files) >= FEWEST and all(map(_begins_at_zero, files.values())):
        yield Check(
            "position_zero",
            (),
            "in all recordings all positions begin at exactly 0: where they count from there no zero is "
            "known, and weights and lengths go astray",
            "nothing is wrong where the arm stood at its zeros, as a simulated one; else give each recording "
            "a columns: of its own with the positions' offset:",
        )


def _begins_at_zero(stream: RecordingStream) -> bool:
    n, m = len(stream.need.joints), len(stream.signal_joints)
    moving = np.flatnonzero(stream.survey.highest[:n] - stream.survey.lowest[:n] > MOVED)
    block = next(iter(stream.table.blocks(stream.names)), np.zeros((0, len(stream.names))))
    if len(moving) < FEWEST or not len(block):
        return False
    first = (block[0] * stream.factors + stream.offsets)[-m:][:n]
    return bool((first[moving] == 0).all())
