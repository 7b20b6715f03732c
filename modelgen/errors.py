"""What every error of this package tells: one sentence, the offender and the remedy."""

from __future__ import annotations


def shortened(text: str, longest: int = 60) -> str:
    """A text that somebody else wrote, on one line and of a length that fits into a sentence."""
    text = " ".join(text.split())
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= longest else text[: longest - 3] + "..."


class ModelgenError(Exception):
    """Bad input to the model generator; the message is one sentence for the user (exit status 2)."""

    exit_status = 2


def _plain(value: object) -> str:
    try:
        return shortened(str(value))
    except (ValueError, RecursionError):  # an integer of thousands of digits
        return f"a value of type {type(value).__name__}"


class ExpressionError(ModelgenError):
    """A value is not plain arithmetic over numbers, pi and the declared constants."""

    def __init__(self, text: object, reason: str) -> None:
        self.text, self.reason = text, reason
        super().__init__(f"{_plain(text)!r} {reason}")


class RobotFileError(ModelgenError):
    """A robot file is missing, unreadable, or describes no robot."""

    def __init__(self, source: str, problem: str) -> None:
        self.source, self.problem = source, problem
        super().__init__(f"{shortened(source)}: {' '.join(problem.split())}")
