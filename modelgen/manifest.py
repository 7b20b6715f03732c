"""The list of what commands wrote into a folder, with hashes: whose a file is, and whether it was changed.

`sha256sum -c written.sha256` reads it. Files stand under the command that wrote them last.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

MANIFEST = "written.sha256"
Written = dict[str, tuple[str, str]]  # path inside the folder -> (sha256, command)


def written(folder: Path) -> Written:
    """What the list in `folder` says; {} without a list."""
    path = folder / MANIFEST
    out: Written = {}
    command = ""
    if not path.is_file():
        return out
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        if line.startswith("# "):
            command = line[2:].partition(":")[0]
        elif len(line) > 66 and ".." not in line[66:].split("/") and not line[66:].startswith("/"):
            out[line[66:]] = (line[:64], command)
    return out


def as_text(entries: Mapping[str, tuple[str, str]]) -> str:
    lines = []
    for command in sorted({command for _, command in entries.values()}):
        lines.append(f"# {command}: it replaces these files when it runs again, unless they were changed")
        lines += [f"{its[0]}  {name}" for name, its in sorted(entries.items()) if its[1] == command]
    return "\n".join(lines) + "\n"


def sha256_of(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def is_ours(path: Path, entry: tuple[str, str] | None) -> bool:
    return entry is not None and path.is_file() and not path.is_symlink() and sha256_of(path) == entry[0]
