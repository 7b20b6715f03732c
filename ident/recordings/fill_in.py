"""Marks in a study that hold every command back: what `ident inspect` could not know."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ident.errors import StudyError

FILL_IN = "FILL IN"


def refuse_marks(data: Any, file: Path, key: str = "") -> None:
    """Raises StudyError for the first value that is still to be filled in."""
    if isinstance(data, str) and data.strip().upper() == FILL_IN:
        raise StudyError(str(file), key, "is still to be filled in; the comment beside it says what is asked")
    if isinstance(data, dict):
        for name, value in data.items():
            refuse_marks(value, file, f"{key}.{name}" if key else str(name))
    if isinstance(data, list):
        for number, value in enumerate(data, 1):
            refuse_marks(value, file, f"{key}[{number}]")
