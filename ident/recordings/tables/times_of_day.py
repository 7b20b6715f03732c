"""Times as spreadsheets and loggers write them, dated or not: `31.03.2024 01:59:50,1`, `1:59:50 PM`.

In what order a date has its day and its month nobody says; it need not be known. A log goes on: where the
time of day falls by more than half a day midnight has passed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

TIME = re.compile(
    r"(?:\d{1,4}[./-]\d{1,2}[./-]\d{1,4},?[T ]+)?"
    r"([01]?\d|2[0-3]):([0-5]\d):([0-5]\d|60)(?:[.,](\d{1,9}))?(?: ?([AP])\.?M\.?)?",
    re.IGNORECASE,
)
DAY = 86400


class Times:
    """Seconds since the first one, block after block."""

    def __init__(self) -> None:
        self.first: float | None = None
        self.last, self.days = 0.0, 0

    def seconds(self, cells: Iterable[str | None]) -> np.ndarray:
        """(N,) of cells; NaN for none. Raises ValueError with a cell that is no time."""
        return np.array([np.nan if cell is None else self._since(cell) for cell in cells], float)

    def _since(self, cell: str) -> float:
        found = TIME.fullmatch(cell.strip())
        if found is None:
            raise ValueError(cell)
        hour, minute, second, fraction, half = found.groups()
        hours = int(hour) if half is None else int(hour) % 12 + 12 * (half in "Pp")
        now = 3600 * hours + 60 * int(minute) + int(second) + float(f"0.{fraction or 0}")
        if self.first is None:
            self.first = self.last = now
        self.days += now < self.last - DAY / 2
        self.last = now
        return now - self.first + DAY * self.days
