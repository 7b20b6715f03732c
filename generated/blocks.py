"""Samples in blocks that stay in the cache, one after the other, and rows shared out among threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

import numpy as np

from generated.errors import GeneratedError
from generated.kernel import LANES, Samples

Array = np.ndarray
BLOCK = 256  # samples: the block buffer stays in the second-level cache
GROUP = 4  # blocks that a thread fills at one go


@dataclass(frozen=True, slots=True)
class Buffer:
    """Room for some blocks: what fills it, and what each block looks like to the consumer."""

    writer: Any
    views: list[Array]


def zero_rows(groups: int, count: int) -> Array:
    """(groups, count, BLOCK + LANES) zeros whose rows start on cache lines but not in the same cache set."""
    width = BLOCK + LANES
    flat = np.zeros(groups * count * width + LANES)
    start = -(flat.ctypes.data // 8) % LANES
    return flat[start : start + groups * count * width].reshape(groups, count, width)


def blocks(
    samples: Samples, buffer: Callable[[int], Buffer], shown: Callable[[Array, int], Array], threads: int
) -> Iterator[tuple[slice, Array]]:
    """Blocks in order; with threads, the next groups of blocks are filled while one is consumed."""
    _check_threads(threads)
    if threads == 1:
        return _serial_blocks(samples, buffer(1), shown)
    return _threaded_blocks(samples, buffer, shown, threads)


def _serial_blocks(samples: Samples, buffer: Buffer, shown: Any) -> Iterator[tuple[slice, Array]]:
    fill, rows, view = buffer.writer.fill, samples.rows, buffer.views[0]
    for first in range(0, rows - BLOCK + 1, BLOCK):
        last = first + BLOCK
        fill(samples, first, last)
        yield slice(first, last), view
    first = rows - rows % BLOCK
    if first < rows:
        fill(samples, first, rows)
        yield slice(first, rows), shown(view, rows - first)


def _threaded_blocks(
    samples: Samples, buffer: Callable[[int], Buffer], shown: Any, threads: int
) -> Iterator[tuple[slice, Array]]:
    """Thread k mod threads fills group k, into one of its own two buffers, which stay in its cache."""
    size = GROUP * BLOCK
    starts = range(0, samples.rows, size)
    threads = min(threads, max(len(starts), 1))
    buffers = [buffer(GROUP) for _ in range(2 * threads)]
    jobs: list[SimpleQueue[int | None]] = [SimpleQueue() for _ in range(threads)]
    ready: list[SimpleQueue[BaseException | None]] = [SimpleQueue() for _ in buffers]

    def work(queue: SimpleQueue[int | None]) -> None:
        while (k := queue.get()) is not None:
            failure = None
            try:
                buffers[k % len(buffers)].writer.fill(samples, starts[k], min(starts[k] + size, samples.rows))
            except BaseException as error:
                failure = error
            ready[k % len(buffers)].put(failure)

    helpers = [threading.Thread(target=work, args=(queue,), daemon=True) for queue in jobs]
    ahead = len(buffers) - 1  # one holds what is being consumed
    for k in range(min(ahead, len(starts))):
        jobs[k % threads].put(k)
    for helper in helpers:
        helper.start()
    try:
        for k, start in enumerate(starts):
            failure = ready[k % len(buffers)].get()
            if failure is not None:
                raise failure
            if k + ahead < len(starts):  # into the buffer whose blocks have had their turn
                jobs[(k + ahead) % threads].put(k + ahead)
            for view, first in zip(buffers[k % len(buffers)].views, range(start, samples.rows, BLOCK)):
                last = min(first + BLOCK, samples.rows)
                yield slice(first, last), shown(view, last - first)
    finally:
        for queue in jobs:
            queue.put(None)
        for helper in helpers:
            helper.join()


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
