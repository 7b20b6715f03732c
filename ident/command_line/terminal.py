"""What the command line shows: a progress bar on a terminal, tables, and nothing of either in a pipe."""

import sys
from collections.abc import Sequence

from modelgen.terminal import progress as progress_bar

__all__ = ["print_table", "progress_bar"]


def print_table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()
) -> None:
    """A table on stdout: ruled on a terminal, tab-separated in a pipe (`cut` and `awk` can read it)."""
    if not sys.stdout.isatty():
        print("\t".join(columns))
        for row in rows:
            print("\t".join(row))
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", title_style="bold")
    for number, column in enumerate(columns):
        table.add_column(column, justify="right" if number in numbers else "left")
    for row in rows:
        table.add_row(*row)
    Console().print(table)
