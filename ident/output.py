"""Output folders that never hold half a result and never cost somebody a file: see `modelgen.output`."""

from modelgen.output import OutputError, beside, staged, write_file

__all__ = ["OutputError", "beside", "staged", "write_file"]
