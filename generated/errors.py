"""What every error of this package tells: one sentence, the offender and the remedy."""

from __future__ import annotations


class GeneratedError(ValueError):
    """A model was asked for, or evaluated with, something it cannot take; the message is one sentence."""

    exit_status = 2
