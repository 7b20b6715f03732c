"""Samples in blocks that stay in the cache, one after the other, and rows shared out among threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import numpy as np

from generated.errors import GeneratedError
from generated.kernel import LANES, Samples

Array = np.ndarray
BLOCK = 256  # samples: the block buffer stays in the second-level cache


def zero_rows(count: int) -> Array:
    """(count, BLOCK + LANES) zeros whose rows start on cache lines but not in the same cache set."""
    width = BLOCK + LANES
    flat = np.zeros(count * width + LANES)
    start = -(flat.ctypes.data // 8) % LANES
    return flat[start : start + count * width].reshape(count, width)


def blocks(
    samples: Samples, fill: Callable[[], int], view: Array, shown: Callable[[Array, int], Array]
) -> Iterator[tuple[slice, Array]]:
    """Blocks in order, each in the one buffer that `fill` writes and `view` shows.

    Nothing is filled ahead by other threads: a block that another core wrote has to come over from its cache,
    which took three times the processor time of writing it here.
    """
    rows = samples.rows
    for first in range(0, rows - BLOCK + 1, BLOCK):
        if not fill():
            samples.refuse(first, first + BLOCK)
        yield slice(first, first + BLOCK), view
    first = rows - rows % BLOCK
    if first < rows:
        if not fill():
            samples.refuse(first, rows)
        yield slice(first, rows), shown(view, rows - first)


def in_parts(part: Callable[[int, int], None], rows: int, threads: int) -> None:
    """Call part(first, last) over all rows, on `threads` threads."""
    _check_threads(threads)
    step = -(-rows // threads)
    step += -step % LANES
    if threads == 1 or step >= rows:
        if rows:
            part(0, rows)
        return
    failures: list[BaseException] = []

    def run(first: int) -> None:
        try:
            part(first, min(first + step, rows))
        except BaseException as error:
            failures.append(error)

    helpers = [threading.Thread(target=run, args=(first,)) for first in range(step, rows, step)]
    for helper in helpers:
        helper.start()
    run(0)
    for helper in helpers:
        helper.join()
    if failures:
        raise failures[0]


def _check_threads(threads: int) -> None:
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or threads < 1:
        raise GeneratedError(f"threads is {threads!r}; give a whole number of at least 1.")
