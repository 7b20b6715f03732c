"""Moved to ident.equations.prepared."""

from ident.equations.prepared import Prepared, prepare_study

__all__ = ["Prepared", "prepare_study"]
