"""The product of `modelgen`: compiled regressors, fast to import and to evaluate.

Symbols, their names in code and their units: the table at the end of README.md.
"""

from generated.errors import GeneratedError
from generated.loading import load
from generated.model import Model

__all__ = ["GeneratedError", "Model", "load"]
