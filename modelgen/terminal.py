"""Progress on a terminal, silence in a pipe, timed lines with -v."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, float], None]  # what is being done, share done of the whole (0..1)


def silent(text: str, done: float) -> None:
    """Progress that nobody watches."""


@contextmanager
def progress(verbose: bool) -> Iterator[Progress]:
    """A bar on stderr if that is a terminal; with `verbose` each step as a timed line."""
    start = time.perf_counter()
    if verbose:
        yield lambda text, done: print(f"{time.perf_counter() - start:6.2f} s  {text}", file=sys.stderr)
        return
    if not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    columns = (BarColumn(bar_width=24), TimeElapsedColumn(), TextColumn("{task.description}"))
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("", total=1.0)
        yield lambda text, done: bars.update(task, description=text, completed=done)
