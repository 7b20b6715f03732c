"""Where a command may write, and how: a folder that is new, empty or its own, whole or not at all.

A folder is ours when it holds `written.sha256` (`sha256sum -c` reads it), which lists what was written, by
which command, with hashes. A file that is not in that list, or that was changed since, is somebody's work and
is replaced only with `overwrite`. What is written is made aside, in `.unfinished-*` of the same folder, and
moved in at the end. The list of the new files, moved into the stage last, is the commit: a run that is killed
after it is completed by the next one, a run that is killed before it leaves nothing but the stage, which the
next run removes (a lock tells whether its owner lives).
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from modelgen.errors import ModelgenError
from modelgen.manifest import MANIFEST, as_text, is_ours, sha256_of, written

UNFINISHED = ".unfinished-"
FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}
UNWRITABLE = FULL | {errno.EROFS, errno.ENAMETOOLONG}  # tell of the output wherever they come from
_open: dict[Path, tuple[int, list[Path]]] = {}  # stages for a signal's handler: owner, folders made for it


class OutputError(ModelgenError):
    """What was named with -o cannot be written, or would cost somebody a file."""


def shown(path: object) -> str:
    """A name as a sentence can hold it."""
    text = str(path)
    return text if len(text) <= 120 else f"{text[:80]}... ({len(text)} characters)"


def beside(path: Path, suffix: str) -> Path:
    """The file of the same name with another ending. Raises OutputError for a path that names no file."""
    if not path.name:
        raise OutputError(f"{shown(path)} is no name of a file; name one with -o")
    return path.with_suffix(suffix)


@contextlib.contextmanager
def staged(
    folder: Path,
    command: str = "dynident",
    *,
    overwrite: bool = False,
    inputs: Iterable[Path] = (),
    complete: bool = True,
) -> Iterator[Path]:
    """A folder to write into, whose files are moved into `folder` when the block ends without an exception.

    `complete`: what `command` wrote before and does not write now is removed, unless it was changed. Files of
    `inputs` are replaced by nothing, whatever `overwrite` says. A folder inside a stage is written to as it
    is. Raises OutputError.
    """
    if any(stage in (folder, *folder.parents) for stage in _open):  # a part of what is being written
        folder.mkdir(parents=True, exist_ok=True)
        yield folder
        return
    with _as_sentence(folder), _noted(folder) as stage:
        _heal(folder)
        if not overwrite:
            _refuse_foreign(folder, command if complete else "")
        stage.mkdir()
        lock = _lock(stage)
        try:
            yield stage
            _commit(folder, stage, command, overwrite, tuple(inputs), complete)
        finally:
            discard(stage)
            if lock is not None:
                os.close(lock)


def write_file(path: Path, data: str | bytes, *, overwrite: bool = False) -> None:
    """One file, whole or not at all; one that is there is replaced with `overwrite` only. Raises
    OutputError."""
    with _as_sentence(path.parent):
        if path.is_dir() or (path.exists() and not path.is_file()):
            raise OutputError(f"{shown(path)} is no file that could be written; name another")
        if (path.exists() or path.is_symlink()) and not overwrite:
            raise OutputError(f"{shown(path)} is there already; name another file, or give --overwrite")
        with _noted(path.parent) as stage:
            stage.write_bytes(data if isinstance(data, bytes) else data.encode())
            os.replace(stage, path)


def discard(stage: Path) -> None:
    """Remove what an unfinished run wrote; what it had decided to write (the list is there) is completed."""
    if (stage / MANIFEST).is_file():
        with contextlib.suppress(OSError):  # then the next run does it
            _move_in(stage.parent, stage)
    if stage.is_dir() and not (stage / MANIFEST).is_file():
        shutil.rmtree(stage, ignore_errors=True)
    elif not stage.is_dir():
        stage.unlink(missing_ok=True)


def discard_all() -> None:
    """Remove the stages of this process (not of one that it was forked from); for a signal's handler."""
    for stage, (owner, made) in list(_open.items()):
        if owner == os.getpid():
            with contextlib.suppress(OSError):
                discard(stage)
            _remove_empty(made)


@contextlib.contextmanager
def _noted(folder: Path) -> Iterator[Path]:
    """A name to write under in `folder`, which is made. Whatever ends the block, neither it nor an empty
    folder is left: a signal's handler knows of both before either is there."""
    if (folder.exists() or folder.is_symlink()) and not folder.is_dir():
        kind = "a file" if folder.is_file() else "no folder"
        raise OutputError(f"cannot write into {shown(folder)}: it is {kind}; name another folder with -o")
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    stage = folder / f"{UNFINISHED}{secrets.token_hex(6)}"
    _open[stage] = (os.getpid(), missing)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield stage
    finally:
        discard(stage)
        _remove_empty(missing)
        del _open[stage]


def _remove_empty(folders: list[Path]) -> None:
    for path in folders:  # innermost first; a folder that got a file stays
        with contextlib.suppress(OSError):
            path.rmdir()


@contextlib.contextmanager
def _as_sentence(folder: Path) -> Iterator[None]:
    """OSError of writing as OutputError; one that tells of a full disk also from inside the block."""
    try:
        yield
    except OSError as error:
        named = str(error.filename or "")
        full = error.errno in FULL or "space left" in str(error) or "too large" in str(error)
        if not full and error.errno not in UNWRITABLE and not named.startswith(str(folder)):
            raise
        said = str(error)
        if "space left" in said:  # Arrow's words, that would say it twice
            said = os.strerror(errno.ENOSPC)
        reason = (error.strerror or said).lower()
        remedy = "make room, or " if full else ""
        text = f"cannot write into {shown(folder)}: {shown(reason)}; {remedy}name another folder with -o"
        raise OutputError(text) from None
    except ValueError as error:
        if "null byte" not in str(error):
            raise
        raise OutputError("a name of a folder has no zero byte; name another with -o") from None


def _refuse_foreign(folder: Path, command: str) -> None:
    """Say early that a folder is somebody else's, or that a file in it was changed since it was written."""
    there = sorted(path.name for path in folder.iterdir() if not path.name.startswith(UNFINISHED))
    if there and MANIFEST not in there:
        raise OutputError(
            f"{shown(folder)} holds {shown(there[0])}, which was not written by this program; "
            "name a new or empty folder with -o, or give --overwrite"
        )
    for name, entry in written(folder).items():
        path = folder / name
        if entry[1] == command and path.exists() and not is_ours(path, entry):
            raise OutputError(_changed(path))


def _changed(path: Path) -> str:
    return (
        f"{shown(path)} was changed since it was written; move it away, name another folder with -o, "
        "or give --overwrite"
    )


def _commit(
    folder: Path, stage: Path, command: str, overwrite: bool, inputs: tuple[Path, ...], complete: bool
) -> None:
    """Check every target, write the list, move everything in."""
    before = written(folder)
    new = {
        path.relative_to(stage).as_posix(): (sha256_of(path), command)
        for path in sorted(stage.rglob("*"))
        if path.is_file()
    }
    for name in new:
        path = folder / name
        _check_target(folder, path, before.get(name), overwrite, inputs)
    gone = {n for n, e in before.items() if complete and e[1] == command and n not in new}
    gone -= {n for n in gone if _is_input(folder / n, inputs)}
    kept = {n: e for n, e in before.items() if n not in gone and (folder / n).exists()}
    (stage / "list").write_text(as_text(kept | new), encoding="utf-8")
    os.replace(stage / "list", stage / MANIFEST)
    _move_in(folder, stage)


def _check_target(
    folder: Path, path: Path, entry: tuple[str, str] | None, overwrite: bool, inputs: tuple[Path, ...]
) -> None:
    for parent in path.relative_to(folder).parents:
        if (folder / parent).exists() and not (folder / parent).is_dir():
            raise OutputError(f"{shown(folder / parent)} stands where a folder is needed; move it away")
    if not path.exists() and not path.is_symlink():
        return
    if _is_input(path, inputs):
        raise OutputError(f"{shown(path)} is an input of this command; name another folder with -o")
    if path.is_dir():
        raise OutputError(f"{shown(path)} is a folder where a file is to be written; move it away")
    if not overwrite and not is_ours(path, entry):
        if entry is not None:
            raise OutputError(_changed(path))
        raise OutputError(
            f"{shown(path)} was not written by this program; move it away, name another folder with -o, "
            "or give --overwrite"
        )


def _is_input(path: Path, inputs: tuple[Path, ...]) -> bool:
    return path.exists() and any(other.exists() and path.samefile(other) for other in inputs)


def _move_in(folder: Path, stage: Path, late: bool = False) -> None:
    """Move what the stage's list names, remove what it no longer names, then the list itself.

    The next run does it again if it was interrupted (`late`): what is moved is no longer in the stage, and a
    file that somebody put there in the meantime stays.
    """
    before, after = written(folder), written(stage)
    for name in after:
        taken = late and (folder / name).exists() and not is_ours(folder / name, before.get(name))
        if (stage / name).is_file() and not taken:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(stage / name, folder / name)
    for name, entry in before.items():
        if name not in after and is_ours(folder / name, entry):
            (folder / name).unlink()
            for parent in (folder / name).relative_to(folder).parents:
                with contextlib.suppress(OSError):
                    if str(parent) != ".":
                        (folder / parent).rmdir()
    os.replace(stage / MANIFEST, folder / MANIFEST)


def _heal(folder: Path) -> None:
    """Complete or remove what runs left that were killed."""
    for stage in folder.glob(f"{UNFINISHED}*"):
        if stage.is_file():
            stage.unlink(missing_ok=True)
            continue
        lock = _lock(stage)
        if lock is None:
            continue
        try:
            if (stage / MANIFEST).is_file():
                _move_in(folder, stage, late=True)
            shutil.rmtree(stage, ignore_errors=True)
        finally:
            os.close(lock)


def _lock(stage: Path) -> Any:
    """A lock on a stage that its owner's end opens, whatever that end is; None if another process has it."""
    try:
        import fcntl
    except ImportError:  # Windows: an open handle keeps the folder from being removed
        return os.open(os.devnull, os.O_RDONLY)
    try:
        handle = os.open(stage, os.O_RDONLY)
    except OSError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            os.close(handle)
            return None
    return handle  # also where locks are not known
