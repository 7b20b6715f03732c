"""What came of one input: accepted, refused in one sentence, or one of the four ways to fail."""

from __future__ import annotations

import signal
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

HANG_S = 20
LONGEST_SENTENCE = 2000  # characters: the command line's own limit
Kind = Literal["accepted", "refused", "traceback", "babble", "hang", "silent"]
BAD: tuple[Kind, ...] = ("traceback", "babble", "hang", "silent")


@dataclass(frozen=True, slots=True)
class Case:
    """An input, and the name of the defect that was planted in it: such a one must be refused."""

    content: Any
    planted: str = ""


@dataclass(frozen=True, slots=True)
class Outcome:
    """`where` tells two failures apart: file, line and error of a traceback, or the defect."""

    kind: Kind
    where: str = ""

    @property
    def bad(self) -> bool:
        return self.kind in BAD


class Hang(BaseException):
    """Nothing came for HANG_S seconds."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise Hang in the main thread after `seconds`."""

    def late(*_: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def judged(trial: Callable[[Any], Any], case: Case, seconds: float = HANG_S) -> Outcome:
    """Try an input. Errors of the project carry an `exit_status`; anything else is a traceback to a user."""
    try:
        with time_limit(seconds):
            trial(case.content)
    except Hang:
        return Outcome("hang", _where(None))
    except Exception as error:
        if not hasattr(error, "exit_status"):
            return Outcome("traceback", _where(error))
        text = str(error)
        plain = "\n" not in text and len(text) <= LONGEST_SENTENCE and text.strip() and text.isprintable()
        return Outcome("refused") if plain else Outcome("babble", _where(error))
    return Outcome("silent", case.planted) if case.planted else Outcome("accepted")


def _where(error: BaseException | None) -> str:
    if error is None:
        return "no answer in time"
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "/tests/" not in f.filename]
    if not frames or type(error).__name__ == "AssertionError":  # what a trial itself found, or was told
        return f"{type(error).__name__}: {' '.join(str(error).split())[:100]}"
    last = next((f for f in reversed(frames) if "site-packages" not in f.filename), frames[-1])
    return f"{type(error).__name__} at {'/'.join(last.filename.split('/')[-2:])}:{last.lineno}"
