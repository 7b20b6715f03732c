"""What the command line shows: a progress bar on a terminal, tables, and nothing of either in a pipe."""

import contextlib
import sys
import time
from collections.abc import Iterator, Sequence

from ident.progress import Progress


@contextlib.contextmanager
def progress_bar(verbose: bool) -> Iterator[Progress]:
    """A bar on stderr if that is a terminal; with `verbose` every step as a timed line; else silence."""
    start = time.perf_counter()

    def tell(text: str, done: float | None = None) -> None:
        if verbose and text != last[0]:
            print(f"{time.perf_counter() - start:6.2f} s  {text}", file=sys.stderr, flush=True)
        last[0] = text

    last = [""]
    if verbose or not sys.stderr.isatty():
        yield tell
        return
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as RichProgress

    columns = (
        SpinnerColumn(),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with RichProgress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)

        def show(text: str, done: float | None = None) -> None:
            told, last[0] = last[0], text  # a step shorter than the bar's own period is shown as well
            total = None if done is None else 1.0
            bar.update(task, description=text, completed=done or 0.0, total=total, refresh=text != told)

        yield show


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
