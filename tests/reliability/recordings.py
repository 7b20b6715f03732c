"""Mutated recordings of a small robot in five formats: opened, examined, and read to the end."""

from __future__ import annotations

import io
import tempfile
import warnings
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from ident.recordings.need import need_of
from ident.recordings.opening import open_recordings
from ident.recordings.study import Study
from tests.reliability.judge import Case
from tests.reliability.mutations import TOKENS

CHUNK = 200
JOINTS, ROWS, RATE = 2, 400, 100.0
FORMATS = ("csv", "parquet", "npz", "mat", "h5")
SPECIAL = (0.0, -1.0, np.nan, np.inf, -np.inf, 1e300, -1e300, 9999.0, 1e-300, 1e12, 1e19)
WORDS = (
    "",
    "NaN",
    "nan",
    "-",
    "n/a",
    "null",
    "1,5",
    "1.2.3",
    "0x10",
    "a",
    "é",
    "1e999",
    "True",
    "2020-01-01T10:00:00",
)


@dataclass(frozen=True, slots=True)
class File:
    """A file's ending and content."""

    ending: str
    data: bytes

    def __repr__(self) -> str:
        return f".{self.ending} {self.data[:300]!r} ({len(self.data)} bytes)"


@cache
def columns() -> dict[str, np.ndarray]:
    """A plain motion with its torques; read only."""
    t = np.arange(ROWS) / RATE
    rng = np.random.default_rng(0)
    found = {"t": t}
    for j in (1, 2):
        found[f"q{j}"] = 0.8 * np.sin(1.3 * j * t + j) + 1e-5 * rng.normal(size=ROWS)
    for j in (1, 2):
        found[f"tau_m{j}"] = 5 * np.cos(1.3 * j * t) + 0.1 * rng.normal(size=ROWS)
    return found


@cache
def _folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="reliability-"))


def written(table: dict[str, Any], ending: str) -> bytes:
    """The table as a file; raises ValueError and the like where the format has no place for it."""
    stream = io.BytesIO()
    if ending == "csv":
        rows = zip(*(np.asarray(v).ravel().tolist() for v in table.values()), strict=False)
        lines = [",".join(table), *(",".join(map(str, row)) for row in rows)]
        return "\n".join(lines).encode() + b"\n"
    if ending == "parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.table({name: pa.array(list(v)) for name, v in table.items()}), stream)
    elif ending == "npz":
        np.savez(stream, **table)
    elif ending == "mat":
        from scipy.io import savemat

        savemat(stream, table)
    else:
        import h5py

        with h5py.File(stream, "w") as file:
            for name, values in table.items():
                file[name] = values
    return stream.getvalue()


def trial(file: File) -> None:
    """Open, survey, read every block."""
    path = _folder() / f"run.{file.ending}"
    path.write_bytes(file.data)
    study = Study(robot="arm", recordings=[{"file": path.name}], file=path.parent / "study.yaml")
    need = need_of("A", tuple(f"tau_m{j}" for j in range(1, JOINTS + 1)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for stream in open_recordings(study, need):
            for _, blocks in stream.segments():
                for values in blocks:
                    assert np.isfinite(values).all(), "a value that is no number went through"


@st.composite
def _tables(draw: st.DrawFn) -> dict[str, Any]:
    table: dict[str, Any] = {name: values.copy() for name, values in columns().items()}
    for _ in range(draw(st.integers(0, 3))):
        name = draw(st.sampled_from(sorted(table) or ["t"]))
        values = table.get(name)
        if (
            not isinstance(values, np.ndarray)
            or values.dtype.kind != "f"
            or values.ndim != 1
            or not len(values)
        ):
            continue
        action = draw(
            st.sampled_from(
                (
                    "set",
                    "run",
                    "scale",
                    "reverse",
                    "shorten",
                    "drop",
                    "rename",
                    "type",
                    "flat",
                    "step",
                    "shuffle",
                )
            )
        )
        start = draw(st.integers(0, len(values) - 1))
        stop = min(len(values), start + draw(st.sampled_from((1, 2, 10, 100, 400))))
        if action == "set":
            values[start] = draw(st.sampled_from(SPECIAL))
        elif action == "run":
            values[start:stop] = draw(st.sampled_from(SPECIAL))
        elif action == "scale":
            values *= draw(st.sampled_from((-1.0, 0.0, 1e3, 1e6, 1e9, 1e-3, 57.2957795, 1e300)))
        elif action == "reverse":
            values[start:stop] = values[start:stop][::-1].copy()
        elif action == "shorten":
            table[name] = values[:start]
        elif action == "drop":
            del table[name]
        elif action == "rename":
            table[draw(st.sampled_from(("", "x", "q1", "é", "time", "q3", "dq1", "TAU_M1")))] = table.pop(
                name
            )
        elif action == "type":
            kind = draw(
                st.sampled_from(("bool", "complex", "int8", "str", "object", "float16", "2-d", "0-d"))
            )
            table[name] = _as_type(values, kind)
        elif action == "flat":
            values[start:] = values[start]
        elif action == "step":
            values[start:] += draw(st.sampled_from((1.0, -1.0, 6.283185307179586, 1e-9, 1e6)))
        else:
            np.random.default_rng(start).shuffle(values)
    if draw(st.integers(0, 5)) == 0:
        rows = draw(st.sampled_from((0, 1, 2, 5, 20)))
        table = {name: np.asarray(v)[:rows] if np.ndim(v) else v for name, v in table.items()}
    return table


def _as_type(values: np.ndarray, kind: str) -> Any:
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if kind == "2-d":
            return np.stack([values, values], axis=1)
        if kind == "0-d":
            return np.float64(1.0)
        if kind == "object":
            return np.array([None, *values[1:]], dtype=object)
        return values.astype(kind)


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """A file of one of five formats, its table mutated, its text or bytes garbled now and then."""
    ending = draw(st.sampled_from(FORMATS))
    table = draw(_tables())
    try:
        data = written(table, ending)
    except Exception:  # no such table in this format
        data = written(dict(columns()), ending)
    if draw(st.integers(0, 3)) == 0:
        for _ in range(draw(st.integers(1, 3))):
            data = _garbled(draw, data, ending)
    return Case(File(draw(st.sampled_from((*[ending] * 60, *FORMATS, "txt", ""))), data))


def _garbled(draw: st.DrawFn, data: bytes, ending: str) -> bytes:
    place = draw(st.integers(0, len(data)))
    action = draw(st.sampled_from(("cut", "bytes", "drop", "word", "head")))
    if action == "cut":
        return data[:place]
    if action == "bytes":
        return (
            data[:place] + draw(st.binary(min_size=1, max_size=8)) + data[place + draw(st.integers(0, 8)) :]
        )
    if action == "drop":
        return data[:place] + data[place + draw(st.integers(1, 200)) :]
    if ending != "csv":
        return data[:place] + bytes(draw(st.integers(1, 64))) + data[place:]
    if action == "head":
        return (
            draw(st.sampled_from(("# a comment\n", "\n\n", "s,rad,rad,Nm,Nm\n", "title\n", ";;\n"))).encode()
            + data
        )
    lines = data.split(b"\n")
    row = draw(st.integers(0, len(lines) - 1))
    cells = lines[row].split(b",")
    cells[draw(st.integers(0, len(cells) - 1))] = draw(st.sampled_from((*WORDS, *TOKENS))).encode()
    return b"\n".join([*lines[:row], b",".join(cells), *lines[row + 1 :]])
