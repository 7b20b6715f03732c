"""Errors of the diagnosis."""

from ident.errors import IdentError


class DiagnosisError(IdentError):
    """The recordings or the study do not allow a diagnosis."""
