"""Which reader opens a table: by the file's ending, or because it is in memory already."""

from __future__ import annotations

import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ident.errors import IdentError, RecordingError
from ident.recordings.tables.bags import bag, bag_files
from ident.recordings.tables.table import Table, damaged

ENDINGS = {
    "parquet": (".parquet", ".pq"),
    "text": (".csv", ".txt", ".tsv", ".dat"),
    "npz": (".npz", ".npy"),
    "mat": (".mat",),
    "hdf5": (".h5", ".hdf5", ".hdf"),
}


def open_table(
    source: Any, decimal: str = ".", name: str = "the table in memory", topic: str | None = None
) -> Table:
    """Open a recording: a path, a dict of arrays, a data frame or Arrow data (`name` stands for its file).

    `topic` chooses among the joint states of a ROS bag, which is a file, a folder or a pattern of parts.

    Raises RecordingError naming the file and the remedy.
    """
    if not isinstance(source, str | Path):
        from ident.recordings.tables.memory import in_memory

        return in_memory(source, name)
    path = Path(source)
    parts = _parts(path)
    for part in parts:
        check_file(part, "metadata.yaml" if part.is_dir() else "")
    if not parts:
        check_file(path)
    reader = (lambda file: bag(str(file), parts, topic)) if parts else _reader(path, decimal)
    try:
        return reader(path)
    except IdentError:
        raise
    except Exception as error:
        raise damaged(str(path), error) from None


def _parts(path: Path) -> list[Path]:
    """The files of a ROS bag, [] for any other path."""
    try:
        return bag_files(path)
    except (OSError, ValueError):  # no path at all; check_file says so
        return []


def check_file(path: Path, inside: str = "") -> None:
    """Raises RecordingError unless the path, or the file `inside` it, can be read and holds something."""
    shown = str(path) if len(str(path)) <= 200 else f"{str(path)[:100]} ... ({len(str(path))} characters)"
    try:
        found = (path / inside).stat()
        if stat.S_ISREG(found.st_mode):
            (path / inside).open("rb").close()
    except (FileNotFoundError, NotADirectoryError):
        raise RecordingError(shown, "there is no such file; check the path in the study") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise RecordingError(
            shown, f"cannot be opened ({reason.lower()}); check the path in the study"
        ) from None
    if stat.S_ISDIR(found.st_mode):
        raise RecordingError(shown, "is a folder, not a recording; name the file inside it")
    if not stat.S_ISREG(found.st_mode):
        raise RecordingError(shown, "is a pipe or a device, not a file; save the recording to a file first")
    if found.st_size == 0:
        raise RecordingError(shown, "is empty; record or copy it again")


def _reader(path: Path, decimal: str) -> Callable[[Path], Table]:
    ending = path.suffix.lower()
    kind = next((kind for kind, endings in ENDINGS.items() if ending in endings), "")
    if kind == "parquet":
        from ident.recordings.tables.arrow import parquet

        return parquet
    if kind == "text":
        from ident.recordings.tables.text import text

        return lambda file: text(file, decimal)
    if kind:
        from ident.recordings.tables import arrays

        return {"npz": arrays.npz, "mat": arrays.mat, "hdf5": arrays.hdf5}[kind]
    raise RecordingError(
        str(path),
        f"the ending {ending or '(none)'} is not known; "
        "convert it to Parquet, CSV, NPZ, MAT, HDF5 or a ROS bag",
    )
