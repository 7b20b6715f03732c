"""How long work tells where it is: a function that is handed in, so that the work itself prints nothing."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

from modelgen.terminal import Progress, silent

__all__ = ["Progress", "part_of", "silent", "watched"]

PERIOD = 0.2  # s between two updates of a notebook's bar


@contextlib.contextmanager
def watched(progress: Callable[..., Any] | bool | None) -> Iterator[Progress]:
    """The door's `progress`: a callback (text, share done or None), True or False, None: a bar in a notebook
    only."""
    if callable(progress):
        yield progress
    elif progress is False or (progress is None and not in_notebook()):
        yield silent
    elif in_notebook():
        yield from _notebook_bar()
    else:
        from modelgen.terminal import progress as bar

        with bar(verbose=False) as tell:
            yield tell


def part_of(progress: Progress, low: float, high: float) -> Progress:
    """For a part of the work that takes it from one share done to another."""

    def tell(text: str, done: float | None = None) -> None:
        progress(text, None if done is None else low + (high - low) * done)

    return tell


def in_notebook() -> bool:
    """Whether a Jupyter kernel is asking; nothing is imported to find out."""
    module = sys.modules.get("IPython")
    shell = module.get_ipython() if module is not None else None
    return type(shell).__name__ == "ZMQInteractiveShell"


def _notebook_bar() -> Iterator[Progress]:
    """A bar in the cell's output that is gone when the work is done."""
    from html import escape

    from IPython.display import HTML, display

    handle = display(HTML(""), display_id=True)
    shown, told = 0.0, ""

    def show(text: str, done: float | None = None) -> None:
        nonlocal shown, told
        now = time.monotonic()
        if text == told and now - shown < PERIOD:
            return
        shown, told = now, text
        value = "" if done is None else f' value="{done:.3f}"'
        handle.update(HTML(f"<progress{value}></progress> {escape(text)}"))

    try:
        yield show
    finally:
        handle.update(HTML(""))
