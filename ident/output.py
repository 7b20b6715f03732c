"""Output folders that never hold half a result: everything is written aside and moved in at the end."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ident.errors import IdentError


class OutputFolderError(IdentError):
    """The folder named with -o cannot be written to."""


def writable(folder: Path) -> None:
    """Say so early if nothing could be written into `folder`. Raises OutputFolderError."""
    with staged(folder):
        pass


@contextlib.contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """A folder to write into, whose files replace those of `folder` when the block ends.

    If the block is left by an exception (Ctrl-C is one), `folder` stays as it was. Each file is moved by
    `os.replace`, so a reader sees the old one or the new one. Other files of `folder` stay.
    Raises OutputFolderError if `folder` is a file or may not be written.
    """
    existed = folder.is_dir()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=folder))
    except OSError as error:
        reason = "it is a file" if folder.is_file() else (error.strerror or str(error)).lower()
        raise OutputFolderError(
            f"cannot write into {folder}: {reason}; name another folder with -o"
        ) from error
    try:
        yield stage
        for path in sorted(stage.rglob("*")):
            target = folder / path.relative_to(stage)
            if path.is_dir():
                target.mkdir(exist_ok=True)
            else:
                os.replace(path, target)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        if not existed and not any(folder.iterdir()):
            folder.rmdir()
