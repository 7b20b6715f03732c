"""How long work tells where it is: a function that is handed in, so that the work itself prints nothing."""

from typing import Protocol


class Progress(Protocol):
    """Called now and then with what is being done and, where known, the share done of the whole (0..1)."""

    def __call__(self, text: str, done: float | None = None) -> None: ...


def silent(text: str, done: float | None = None) -> None:
    """The progress of a pipe, a test or a notebook: nothing."""
