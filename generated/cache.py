"""The cache of derived models and compiled kernels: entries are folders named by the hash of what made them.

An entry is written under another name, with the checksum of each file, and renamed: it is whole or absent.
An entry whose checksums do not hold is removed and made again. Code is loaded from here, so the folder must
belong to the user and be closed to others; else a private folder is used that dies with the process.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import re
import shutil
import stat
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

MANIFEST = "checksums.json"
UNUSED_DAYS = 30


def key(*parts: bytes | str) -> str:
    """SHA-256 over parts of any length; the borders between parts count."""
    total = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        total.update(len(data).to_bytes(8, "little") + data)
    return total.hexdigest()


def folder() -> Path:
    """DYNIDENT_CACHE, else the user's cache folder; a private temporary one if that is not safely theirs."""
    chosen = os.environ.get("DYNIDENT_CACHE")
    if not chosen:
        import platformdirs

        chosen = platformdirs.user_cache_dir("dynident", appauthor=False)
    return _checked(os.path.abspath(os.path.expanduser(chosen)), os.getpid())


@cache
def _checked(chosen: str, process: int) -> Path:
    path = Path(chosen)
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        problem = _problem(path)
        if not problem:
            with tempfile.NamedTemporaryFile(dir=path):
                pass
    except OSError as error:
        problem = f"cannot be written ({error.strerror})"
    if not problem:
        return path
    warnings.warn(
        f"The cache folder {path} {problem}; models are compiled for this process only. "
        "Set DYNIDENT_CACHE to a folder of your own with mode 0700.",
        stacklevel=2,
    )
    private = Path(tempfile.mkdtemp(prefix="dynident-"))
    atexit.register(_remove_own, private, process)
    return private


def _remove_own(path: Path, process: int) -> None:
    if os.getpid() == process:  # not in a forked child
        shutil.rmtree(path, ignore_errors=True)


def _problem(path: Path) -> str:
    """Why code must not be loaded from `path`; "" when it may."""
    if os.name == "nt":
        return ""
    status = os.stat(path)
    if not stat.S_ISDIR(status.st_mode):
        return "is not a folder"
    if status.st_uid != os.getuid():
        return "belongs to another user"
    if status.st_mode & 0o022:
        return "can be written by others"
    for parent in path.resolve().parents:
        mode = os.stat(parent).st_mode
        if mode & 0o002 and not mode & stat.S_ISVTX:
            return f"lies in {parent}, which anyone can write,"
    return ""


def entry(name: str, build: Callable[[Path], None]) -> Path:
    """The folder of entry `name`, built by `build(empty folder)` if it is absent or damaged."""
    root = folder()
    place = root / name
    if _whole(place):
        with suppress(OSError):
            os.utime(place / MANIFEST)  # in use
        return place
    _prune(root)
    temporary = Path(tempfile.mkdtemp(prefix=".new-", dir=root))
    try:
        build(temporary)
        _seal(temporary)
        _move(temporary, place)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return place


def _prune(root: Path) -> None:
    """Remove entries that nobody used for a while, and what a killed process left."""
    oldest = time.time() - UNUSED_DAYS * 86400
    for place in root.iterdir():
        with suppress(OSError):
            manifest = place / MANIFEST
            used = (manifest if manifest.is_file() else place).stat().st_mtime
            if used < oldest and re.match(r"(kernel|model|peer)-|\.(new|old)-", place.name):
                shutil.rmtree(place, ignore_errors=True)


def _move(temporary: Path, place: Path) -> None:
    for _ in range(10):
        try:
            temporary.rename(place)
            return
        except OSError:
            if _whole(place):  # another process was first
                return
            grave = Path(tempfile.mkdtemp(prefix=".old-", dir=place.parent))
            try:
                place.rename(grave / "entry")
            except OSError:
                pass
            finally:
                shutil.rmtree(grave, ignore_errors=True)
    raise OSError(f"the cache entry {place} cannot be replaced; remove it")


def _seal(path: Path) -> None:
    sums = {f.name: _sha256(f) for f in sorted(path.iterdir())}
    (path / MANIFEST).write_text(json.dumps(sums), encoding="utf-8")


def _whole(path: Path) -> bool:
    try:
        if os.name != "nt" and _problem(path):
            return False
        sums: Mapping[str, str] = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
        return bool(sums) and all(_sha256(path / name) == value for name, value in sums.items())
    except (OSError, ValueError, AttributeError):
        return False


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
