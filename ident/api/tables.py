"""Tables as the user has them: a pandas data frame where pandas is installed, else an Arrow table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def frame(columns: Mapping[str, Any]) -> Any:
    """Columns of one length by name. Arrow has every row's value; pandas is no dependency."""
    try:
        import pandas as pd
    except ImportError:
        import pyarrow as pa

        return pa.table({name: pa.array(values) for name, values in columns.items()})
    return pd.DataFrame(dict(columns))


def of_rows(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Rows with the same keys."""
    names = dict.fromkeys(name for row in rows for name in row)
    return frame({name: [row.get(name) for row in rows] for name in names})


def arrays(t: Sequence[np.ndarray], values: Sequence[np.ndarray], names: Sequence[str]) -> dict[str, Any]:
    """Pieces t (m,), values (m, channels) one after the other as columns t and one per name."""
    whole = np.concatenate(values) if values else np.zeros((0, len(names)))
    times = np.concatenate(t) if t else np.zeros(0)
    return {"t": times} | {name: whole[:, k] for k, name in enumerate(names)}
