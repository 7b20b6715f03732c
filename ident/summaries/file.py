"""The summary file, `NAME.ident.parquet`: one row a window, what they share in the file's metadata.

Columns: recording, start, stop, seconds; heat, speed, load (lists, one number a joint); and for each channel
X: `R.X` the triangular factor of [W_X Y_X] row by row, `rows.X`, `products.X`, `counts.X`. Key `ident` of the
metadata is JSON: robot, model, parameters, units, channels, columns of each factor, cut-off, checks.
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ident.equations.observation import ChannelFactor
from ident.summaries.arrow import array
from ident.summaries.window import SummaryError, Window

ENDING = ".ident.parquet"
VERSION = 1
TIMES, MOTION = ("start", "stop", "seconds"), ("heat", "speed", "load")


@dataclass(frozen=True, slots=True)
class Header:
    """What the windows of a summary share; `checks` are sentences."""

    robot: str
    model: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    channels: tuple[str, ...]
    joints: tuple[str, ...]
    joint_of: tuple[int, ...]  # position of each channel's joint
    columns: tuple[tuple[int, ...], ...]  # of each channel's factor
    cutoff_hz: float
    position_cutoff_hz: float
    checks: tuple[str, ...] = ()
    key: str = ""  # of what it was made from

    def fits(self, other: Header) -> str:
        """Why two summaries cannot be added, "" where they can."""
        for name in ("robot", "model", "parameters", "channels", "cutoff_hz", "position_cutoff_hz"):
            mine, its = getattr(self, name), getattr(other, name)
            if mine != its:
                return f"their {name.replace('_', ' ')} differ" + (
                    f" ({mine} and {its})" if isinstance(mine, str | float) else ""
                )
        return ""


@dataclass(frozen=True, slots=True)
class Summary:
    header: Header
    windows: tuple[Window, ...]


def written(summary: Summary) -> bytes:
    """The file's content: the same bytes for the same summary."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    header, windows = summary.header, summary.windows
    number, numbers = pa.float64(), pa.list_(pa.float64())
    columns: dict[str, Any] = {"recording": array([w.recording for w in windows], pa.string())}
    columns |= {name: array([getattr(w, name) for w in windows], number) for name in TIMES}
    columns |= {name: array([getattr(w, name) for w in windows], numbers) for name in MOTION}
    for j, channel in enumerate(header.channels):
        columns[f"R.{channel}"] = array([w.factors[j].R.ravel() for w in windows], numbers)
        columns[f"rows.{channel}"] = array([w.factors[j].rows for w in windows], pa.int64())
        columns[f"products.{channel}"] = array([w.products[j] for w in windows], numbers)
        columns[f"counts.{channel}"] = array([w.counts[j] for w in windows], numbers)
    table = pa.table(columns)
    note = json.dumps({"version": VERSION} | asdict(header), sort_keys=True)
    out = io.BytesIO()
    pq.write_table(table.replace_schema_metadata({"ident": note}), out, compression="zstd")
    return out.getvalue()


def read(data: bytes, file: str) -> Summary:
    """A summary from a file's content; `file` is what messages name. Raises SummaryError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.ParquetFile(io.BytesIO(data)).read(use_threads=False)  # read_table imports datasets
        note = json.loads((table.schema.metadata or {})[b"ident"])
        if note.pop("version") != VERSION:
            raise SummaryError(f"{file} was written by another version; make it again from its recording")
        header = Header(**{name: _frozen(value) for name, value in note.items()})
        columns = table.to_pydict()
        windows = tuple(_window(header, columns, k) for k in range(table.num_rows))
    except (pa.ArrowInvalid, OSError, KeyError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}".splitlines()[0][:120]
        raise SummaryError(f"{file} is no summary ({reason}); make it again from its recording") from None
    return Summary(header, windows)


def _window(header: Header, columns: dict[str, list[Any]], k: int) -> Window:
    factors = []
    for its, channel in zip(header.columns, header.channels):
        R = np.array(columns[f"R.{channel}"][k], float).reshape(-1, len(its) + 1)
        factors.append(ChannelFactor(np.array(its, int), R, columns[f"rows.{channel}"][k]))
    products, counts = (
        np.array([columns[f"{name}.{channel}"][k] for channel in header.channels])
        for name in ("products", "counts")
    )
    plain: dict[str, Any] = {name: columns[name][k] for name in ("recording", *TIMES)}
    motion: dict[str, Any] = {name: np.array(columns[name][k], float) for name in MOTION}
    return Window(factors=tuple(factors), products=products, counts=counts, **plain, **motion)


def _frozen(value: Any) -> Any:
    return tuple(_frozen(item) for item in value) if isinstance(value, list) else value


def together(summaries: Sequence[Summary], names: Sequence[str]) -> Header:
    """The header of summaries that can be added. Raises SummaryError naming the one that cannot."""
    for summary, name in zip(summaries[1:], names[1:]):
        if why := summaries[0].header.fits(summary.header):
            raise SummaryError(
                f"{names[0]} and {name} cannot be added: {why}; make both again with one study"
            )
    return summaries[0].header
