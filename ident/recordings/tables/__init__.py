"""Tables on disk or in memory as a stream of number blocks."""

from ident.recordings.tables.episodes import one_episode
from ident.recordings.tables.files import open_table
from ident.recordings.tables.table import Table

__all__ = ["Table", "one_episode", "open_table"]
