"""Files of arrays: NumPy, MATLAB, HDF5. A two-dimensional array named q with n columns stands for q1..qn.

HDF5 (and with it MATLAB from 7.3 on) is read slice by slice; the other two formats are read at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ident.errors import RecordingError
from ident.recordings.tables import table as of
from ident.recordings.tables.mat_file import numeric_arrays
from ident.recordings.tables.table import Blocks, Table, flattened


def npz(path: Path) -> Table:
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        named = loaded.dtype.names and loaded.ndim == 1
        return flattened(
            str(path), {k: loaded[k] for k in loaded.dtype.names} if named else {"table": loaded}
        )
    with loaded:
        return flattened(str(path), {name: loaded[name] for name in loaded.files})


def mat(path: Path) -> Table:
    with path.open("rb") as opened:
        if b"\x89HDF\r\n" in opened.read(1024):  # from 7.3 on, behind 512 bytes of text
            return hdf5(path)
    found = numeric_arrays(path.read_bytes())
    return flattened(str(path), {short: found[name] for short, name in _short(found, ".").items()})


def _short(names: Iterable[str], by: str) -> dict[str, str]:
    """{the last part of a path, or the whole one with dots where several end alike: the path}."""
    last = Counter(name.rsplit(by, 1)[-1] for name in names)
    return {
        short if last[short] == 1 else name.replace(by, "."): name
        for name in names
        for short in [name.rsplit(by, 1)[-1]]
    }


def hdf5(path: Path) -> Table:
    """Datasets at any depth, read slice by slice. The last part of a dataset's path is its name, the whole
    path (with dots) where several end alike."""
    import h5py

    places: dict[str, tuple[str, int | None, bool]] = {}  # column: dataset, index in it, transposed
    with h5py.File(path, "r") as opened:
        shapes: dict[str, tuple[int, ...]] = {}
        opened.visititems(
            lambda name, item: (
                shapes.__setitem__(name, item.shape)
                if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and item.ndim in (1, 2)
                else None
            )
        )
    found = {short: (name, shapes[name]) for short, name in _short(shapes, "/").items()}
    if not found:
        raise RecordingError(str(path), "holds no numeric dataset; save t, q, tau_m or tau_l in it")
    n_rows = max(max(shape) for _, shape in found.values())
    for name, (where, shape) in found.items():
        if n_rows not in shape:
            continue
        flipped = shape[0] != n_rows
        width = 1 if len(shape) == 1 else shape[0 if flipped else 1]
        if width == 1:
            places[name] = (where, None if len(shape) == 1 else 0, flipped)
        else:
            only = len(found) == 1
            places |= {str(k) if only else f"{name}{k + 1}": (where, k, flipped) for k in range(width)}

    def read(columns: Sequence[str]) -> Blocks:
        with h5py.File(path, "r") as opened:
            for start in range(0, n_rows, of.ROWS):
                rows = slice(start, start + of.ROWS)
                block = []
                for name in columns:
                    where, k, flipped = places[name]
                    data = opened[where]
                    block.append(data[rows] if k is None else data[k, rows] if flipped else data[rows, k])
                yield np.column_stack(block).astype(float)

    return Table(str(path), tuple(places), not all(name.isdigit() for name in places), read)
