"""Several episodes in one table, as robot learning data sets keep them: read one at a time, never mixed.

A table whose episodes are told apart by a column (LeRobot's `episode_index`) is one recording an episode; the
study names it (`episode: 3`). Which there are is seen in one pass over that column alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.errors import RecordingError
from ident.recordings.held import Held
from ident.recordings.tables.table import Blocks, Table

NAMES = ("episode_index", "episode_id", "episode")
MOST = 10_000


def episodes_of(table: Table) -> tuple[str, tuple[int, ...]]:
    """The column that tells them apart and its numbers in order, ("", ()) where there is none."""
    column = next((name for name in NAMES if name in table.columns), "")
    if not column:
        return "", ()
    found: set[float] = set()
    try:
        for block in table.blocks([column]):
            found |= set(np.unique(block[np.isfinite(block)]).tolist())
            if len(found) > MOST or any(value != int(value) for value in found):
                return "", ()  # no numbers of episodes
    except RecordingError:  # text
        return "", ()
    return column, tuple(sorted(int(value) for value in found))


def one_episode(table: Table, wanted: int | None) -> Table:
    """The rows of one episode; a table that has one or none as it is. Raises RecordingError."""
    column, present = episodes_of(table)
    if wanted is None and len(present) < 2:
        return table
    if wanted is None:
        raise RecordingError(
            table.file,
            f"holds {len(present)} episodes ({column} {present[0]} to {present[-1]}), each a run of its own; "
            f"name one beside the file, as episode: {present[0]}, and give every other a line of its own",
        )
    if wanted not in present:
        known = f"its {column} goes from {present[0]} to {present[-1]}" if present else "it tells none apart"
        raise RecordingError(table.file, f"has no episode {wanted}; {known}")

    def read(names: Sequence[str]) -> Blocks:
        for block in table.blocks([column, *names]):
            rows = block[:, 0] == wanted
            if rows.any():
                yield block[rows, 1:]

    return replace(table, read=read, held=Held())
