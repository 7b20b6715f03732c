"""Progress on a terminal, silence in a pipe, timed lines with -v. Of both packages' commands."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Progress(Protocol):
    """Called now and then with what is being done and, where known, the share done of the whole (0..1)."""

    def __call__(self, text: str, done: float | None = None) -> None: ...


def silent(text: str, done: float | None = None) -> None:
    """Progress that nobody watches."""


@contextmanager
def progress(verbose: bool) -> Iterator[Progress]:
    """A bar on stderr if that is a terminal; with `verbose` each step as a timed line; else silence."""
    if verbose:
        yield timed_lines()
        return
    if not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    columns = (
        SpinnerColumn(),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("", total=None)
        told = ""

        def show(text: str, done: float | None = None) -> None:
            nonlocal told
            total = None if done is None else 1.0
            # a step shorter than the bar's own period is shown as well
            bars.update(task, description=text, completed=done or 0.0, total=total, refresh=text != told)
            told = text

        yield show


def timed_lines() -> Progress:
    """Each step as a line with its time on stderr."""
    start, told = time.perf_counter(), ""

    def tell(text: str, done: float | None = None) -> None:
        nonlocal told
        if text != told:
            print(f"{time.perf_counter() - start:6.2f} s  {text}", file=sys.stderr, flush=True)
        told = text

    return tell
