"""How much memory a diagnosis may take, and how many rows fit into it.

Rows of both sides hold the model's columns as they are, whitened twice over and once in the metric that
compares hypotheses; beside them stand the fine signals of their stretches and columns of candidates. Fewer
rows are looked at where there is less room, down to LEAST a side; below that the diagnosis says what it
needs.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from ident.equations.fine import stride_of
from ident.equations.prepared import Prepared
from ident.errors import IdentError
from ident.progress import Progress
from ident.signals.decimation import kept_every

MOST, LEAST = 7000, 1500  # rows of the fitted, and of the judged recordings
COPIES = 6.0  # of the model's columns, whitened and not
FINE = 10.0  # of the fine signals: what functions of them take while they are scored
LIBRARY, LIBRARY_LEAST = 1.5e8, 3e7  # bytes of candidates' columns
PROGRAM = 1.5e8  # bytes that opening and reporting add, whatever the study
VARIES = 1e7  # bytes by which the same program grows differently, started again
SHARE = 0.35  # of what is free beside the program
GROWN = 4e7  # bytes, from which on it is worth asking what can be given back
FREE = 0.5  # of the machine's free memory, where no limit is given


class MemoryLimitError(IdentError):
    """The limit is below what the least diagnosis of this study takes."""


@dataclass(frozen=True, slots=True)
class Room:
    """rows a side, bytes of candidates' columns."""

    rows: int
    library: float


def room_for(prepared: Prepared, cutoff_hz: float, memory: float | None) -> Room:
    """From a limit in bytes; None: half of what is free. Raises MemoryLimitError."""
    taken, free = _resident(), _free()
    limit = memory if memory is not None else None if free is None else taken + FREE * free
    row = bytes_a_row(prepared, cutoff_hz)
    if limit is None:
        return Room(MOST, LIBRARY)
    there = sum(stream.survey.rows / kept_every(cutoff_hz, stream.rate_hz) for stream in prepared.streams)
    needed = taken + PROGRAM + min(2.0 * LEAST, there) * row + LIBRARY_LEAST
    if limit < needed:
        asked = np.ceil((needed + VARIES) / 1e7) / 100
        raise MemoryLimitError(
            f"--memory {limit / 1e9:.2g}GB is too little for this study: it needs {asked:.4g}GB; give that "
            "much, or leave recordings or channels out"
        )
    library = min(LIBRARY, max(LIBRARY_LEAST, SHARE * (limit - taken - PROGRAM)))
    return Room(int(min(MOST, max(LEAST, (limit - taken - PROGRAM - library) / row / 2))), library)


def bytes_a_row(prepared: Prepared, cutoff_hz: float) -> float:
    """What one more instant costs, columns of every channel and its fine signals."""
    columns = prepared.columns
    pairs = {(e.channel, e.column) for e in columns.extras}
    for payload in (None, *prepared.study.payloads):
        _, channel, column = columns.entries(payload)
        pairs |= {(int(c), int(k)) for c, k in zip(channel, column) if k >= 0}
    fine = max(
        kept_every(cutoff_hz, stream.rate_hz)
        / stride_of(kept_every(cutoff_hz, stream.rate_hz), stream.rate_hz)
        for stream in prepared.streams
    )
    signals = 1 + 6 * len(columns.need.joints) + len(columns.channels)
    return 8.0 * (COPIES * len(pairs) + FINE * fine * signals)


def thrifty(progress: Progress) -> Progress:
    """The same, and at every new thing that is told what is free inside the process goes back to the system
    where the process has grown: the C library keeps what lies between values that live, Arrow what it may
    need again. (Each time costs as much as a tenth of a second.)"""
    last, kept = "", 0.0

    def tell(text: str, done: float | None = None) -> None:
        nonlocal last, kept
        if text != last:
            last = text
            if _resident() > kept + GROWN:
                _give_back()
                kept = _resident()
        progress(text, done)

    return tell


def _give_back() -> None:
    import ctypes
    import gc

    import pyarrow as pa

    gc.collect()
    pa.default_memory_pool().release_unused()
    try:
        ctypes.CDLL(None).malloc_trim(0)  # glibc; other systems have none
    except (AttributeError, OSError, TypeError):
        return


def _resident() -> float:
    """Bytes that the process has now."""
    try:
        with open("/proc/self/statm", "rb") as file:
            return float(int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
    except (OSError, ValueError, AttributeError):
        return 3e8


def _free() -> float | None:
    """Bytes that other programs leave; None where the system does not say."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            lines = dict(line.split(":", 1) for line in file)
        return 1024.0 * float(lines["MemAvailable"].split()[0])
    except (OSError, ValueError, KeyError):
        return None
