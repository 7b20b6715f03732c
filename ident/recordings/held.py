"""What one pass over a recording read or computed and the next ones would again: kept where it is small.

A minute is read and filtered once, an hour at every pass: memory does not grow with the log, nor with how
many there are.
"""

from __future__ import annotations

import weakref
from collections.abc import Hashable, Iterable, Iterator
from typing import Any, Protocol, TypeVar

NUMBERS = 3_000_000  # of one recording's blocks; longer ones are made again each time
TOGETHER = 12_000_000  # of all: a hundred runs of a minute are read again as one of an hour is


class Sized(Protocol):
    @property
    def size(self) -> int: ...  # numbers


T = TypeVar("T", bound=Sized)


class Held(dict[Hashable, list[Any]]):
    """Blocks by what they were made with; all that live are counted together."""

    __slots__ = ("__weakref__",)
    __hash__ = object.__hash__  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        return self is other

    def blocks(self, key: Hashable, made: Iterable[T]) -> Iterator[T]:
        """Those kept under this key; else what is `made`, kept where it is small once all was asked for."""
        if key in self:
            yield from self[key]
            return
        fresh: list[T] = []
        size = 0
        for block in made:
            size += block.size
            if size <= NUMBERS:
                fresh.append(block)
            else:
                fresh.clear()
            yield block
        if size <= NUMBERS and size + _numbers_held() <= TOGETHER:
            self[key] = fresh
            _LIVE.add(self)


_LIVE: weakref.WeakSet[Held] = weakref.WeakSet()


def _numbers_held() -> int:
    return sum(block.size for held in list(_LIVE) for blocks in list(held.values()) for block in blocks)
