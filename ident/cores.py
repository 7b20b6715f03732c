"""Work that two cores share: numpy lets go of the interpreter's lock while it works on large arrays.

Results come in the order in which they were asked for, so that what follows from them is the same on one
core. It pays for products of large arrays alone: columns of single effects, some ten microseconds a call,
take half as much processor time again on two threads and no less time by the clock."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from itertools import islice
from typing import TypeVar

CORES = 2
WAITING = 4  # begun, or done and not yet taken
_own = threading.local()

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_order(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """`map(function, items)`, on two threads where there are two cores. What is shared already is not shared
    again."""
    if available() < CORES or getattr(_own, "shared", False):
        yield from map(function, items)
        return
    rest = iter(items)
    with ThreadPoolExecutor(CORES, initializer=_begin) as pool:
        begun: deque[Future[Result]] = deque(pool.submit(function, item) for item in islice(rest, WAITING))
        while begun:
            result = begun.popleft().result()
            begun.extend(pool.submit(function, item) for item in islice(rest, 1))
            yield result


def one_blas_thread() -> AbstractContextManager[object]:
    """BLAS on one thread meanwhile: small matrices' threads wait for each other, and several processes share
    a machine better so."""
    from threadpoolctl import threadpool_limits  # not at start-up: not every command computes

    return threadpool_limits(1, "blas")


def available() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):  # not on every system
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _begin() -> None:
    _own.shared = True
