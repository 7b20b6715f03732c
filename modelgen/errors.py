"""What every error of this package tells: one sentence, the offender and the remedy."""


class ModelgenError(Exception):
    """Bad input to the model generator; the message is one sentence for the user (exit status 2)."""
