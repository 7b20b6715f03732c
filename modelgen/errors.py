"""What every error of this package tells: one sentence, the offender and the remedy."""

from __future__ import annotations


class ModelgenError(Exception):
    """Bad input to the model generator; the message is one sentence for the user (exit status 2)."""

    exit_status = 2


class ExpressionError(ModelgenError):
    """A value is not plain arithmetic over numbers, pi and the declared constants."""

    def __init__(self, text: object, reason: str) -> None:
        self.text, self.reason = text, reason
        shown = str(text)
        super().__init__(f"{shown if len(shown) <= 60 else shown[:57] + '...'!r} {reason}")


class RobotFileError(ModelgenError):
    """A robot file is missing, unreadable, or describes no robot."""

    def __init__(self, source: str, problem: str) -> None:
        self.source, self.problem = source, problem
        super().__init__(f"{source}: {problem}")


class RegroupingError(ModelgenError):
    """The regrouping rules could not be derived, or failed their exact check."""
