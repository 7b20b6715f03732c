"""What every error of this package tells: one sentence, the offender and the remedy."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator


class IdentError(Exception):
    """Bad input to the identification; the message is one sentence for the user (exit status 2).

    `ident.Error`: what the door raises is this or a subclass (see `one_family`).
    """

    exit_status = 2

    def __str__(self) -> str:
        """Names and cells of somebody's file may hold what no terminal should be sent."""
        return "".join(c if c.isprintable() or c == "\n" else "?" for c in super().__str__())


class StudyError(IdentError):
    """A study file that cannot be used: the key, the file and what to write instead."""

    def __init__(self, file: str, key: str, problem: str) -> None:
        self.file, self.key = file, key
        super().__init__(f"{file}: {key}: {problem}" if key else f"{file}: {problem}")


class RecordingError(IdentError):
    """A recording that cannot be read or believed: the file, where in it, and the remedy.

    `checks`: what the examination found until then (ident/examination/check.py)."""

    def __init__(self, file: str, problem: str, checks: tuple = ()) -> None:
        self.file, self.checks = file, checks
        super().__init__(f"{file}: {problem}")


class NotEnoughDataError(IdentError):
    """Fewer decimated rows than parameters, or no motion at all."""


class FitFailedError(IdentError):
    """The input was understood and yet no parameters came out (exit status 1)."""

    exit_status = 1


@contextlib.contextmanager
def one_family() -> Iterator[None]:
    """Errors of the model generator and of compiled models as IdentError, with the same sentence."""
    try:
        yield
    except IdentError:
        raise
    except Exception as error:
        if not hasattr(error, "exit_status"):
            raise
        raise IdentError(str(error)) from error
