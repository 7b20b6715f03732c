"""The product of `modelgen`: compiled regressors, fast to import and to evaluate."""

from generated.errors import GeneratedError
from generated.loading import load
from generated.model import Model

__all__ = ["GeneratedError", "Model", "load"]
