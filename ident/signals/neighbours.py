"""Filtered blocks with their neighbours: for what needs some motion before and after the samples it makes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace

import numpy as np

from ident.signals.filtering import FilteredBlock

WHOLE = ("vs", "before")  # of a block, no signals along it


def by_segment(
    blocks: Iterable[tuple[int, FilteredBlock]],
) -> Iterator[tuple[int, Iterator[FilteredBlock]]]:
    """Numbered blocks grouped by stretch; each group is to be used up before the next."""
    for index, group in itertools.groupby(blocks, key=lambda item: item[0]):
        yield index, (block for _, block in group)


def first_samples(
    blocks: Iterable[tuple[int, FilteredBlock]], samples: int
) -> Iterator[tuple[int, FilteredBlock]]:
    """The blocks that hold the first `samples` of a recording."""
    done = 0
    for index, block in blocks:
        yield index, block
        done += len(block.t)
        if done >= samples:
            return


def wide_blocks(blocks: Iterable[FilteredBlock], halo: int) -> Iterator[tuple[FilteredBlock, slice]]:
    """Blocks of one stretch with up to `halo` samples of their neighbours, and where the block is in it."""
    before: FilteredBlock | None = None
    current: FilteredBlock | None = None
    for after in itertools.chain(blocks, [None]):
        if current is not None:
            head = 0 if before is None else len(before.t)
            kept = current if before is None or not head else joined([before, current])
            behind = sliced(after, slice(0, halo)) if after is not None and halo else None
            yield kept if behind is None else joined([kept, behind]), slice(head, head + len(current.t))
            before = sliced(kept, slice(max(len(kept.t) - halo, 0), None)) if halo else None
        current = after


def sliced(block: FilteredBlock, rows: slice) -> FilteredBlock:
    """Some samples of a block."""
    its = _mapped(block, lambda name: getattr(block, name)[rows])
    return replace(its, before=None) if rows.start else its


def picked(block: FilteredBlock, rows: np.ndarray) -> FilteredBlock:
    """Samples (k,) of a block by their numbers, copied."""
    return _mapped(block, lambda name: getattr(block, name)[rows])


def joined(blocks: Sequence[FilteredBlock]) -> FilteredBlock:
    """Consecutive blocks as one."""
    return _mapped(blocks[0], lambda name: np.concatenate([getattr(block, name) for block in blocks]))


def _mapped(block: FilteredBlock, made: Callable[[str], np.ndarray]) -> FilteredBlock:
    """A block with every signal that `block` has made by its name."""
    signals = [f.name for f in fields(block) if f.name not in WHOLE and getattr(block, f.name) is not None]
    return replace(block, **{name: made(name) for name in signals})
