"""Which recordings of which robots: from a pattern or a table, wherever fsspec finds them.

A pattern names its robots by `{robot}` and its days by `{day}` (`s3://logs/{robot}/{day}.parquet`); without
them a recording's folder is its robot and its name its day. A table (CSV) has columns file, robot and, if
recordings are not in the order of their names, day; files are relative to it.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

from ident.errors import IdentError
from ident.recordings.tables.files import ENDINGS
from modelgen.errors import shortened

MAGIC = set("*?[{")


class FleetError(IdentError):
    """A fleet that cannot be read, named or reached; the message is one sentence."""


@dataclass(frozen=True, slots=True)
class Job:
    """One recording of one robot; `key` changes with the file, the robot's model and the study."""

    robot: str
    day: str
    url: str
    key: str

    @property
    def order(self) -> tuple[str, str, str]:
        return self.robot, self.day, self.url

    @property
    def file(self) -> str:
        """Name of its summary, inside the folder of its robot."""
        return f"{re.sub(r'[^A-Za-z0-9._-]', '_', self.day)[:80]}-{self.key[:12]}.ident.parquet"


def find(source: str, settings: str) -> tuple[Job, ...]:
    """The jobs of a pattern or table in their order; `settings` is what results depend on beside the file.
    Raises FleetError."""
    if not MAGIC & set(source) and source.lower().endswith(".csv"):
        named = _of_table(source)
    else:
        named = _of_pattern(source)
    jobs = [Job(robot, day, url, _key(url, settings)) for url, (robot, day) in named.items()]
    if not jobs:
        raise FleetError(
            f"{shortened(source)} names no recording; check the pattern (in quotes) or the table"
        )
    seen: dict[tuple[str, str], str] = {}
    for job in jobs:
        for part in (job.robot, job.day):
            if not part.strip() or part in (".", ".."):
                raise FleetError(f"{shortened(job.url)}: {part!r} names no robot or day; name both")
        other = seen.setdefault((job.robot, job.day), job.url)
        if other != job.url:
            raise FleetError(
                f"{shortened(other)} and {shortened(job.url)} are both {job.day} of {job.robot}; "
                "give days of their own with {day} or the table's column day"
            )
    return tuple(sorted(jobs, key=lambda job: job.order))


def _of_pattern(pattern: str) -> dict[str, tuple[str, str]]:
    fields = re.findall(r"\{(\w+)\}", pattern)
    if set(fields) - {"robot", "day"} or len(fields) != len(set(fields)):
        raise FleetError(f"{shortened(pattern)}: a pattern knows {{robot}} and {{day}}, each once")
    with _reached(pattern):
        fs, path = _filesystem(re.sub(r"\{\w+\}", "*", pattern))
        found = sorted(fs.glob(path)) if MAGIC & set(path) else [path] * fs.exists(path)
        found = [name for name in found if not fs.isdir(name)]
    if fields:
        shape = _expression(path_of(pattern, fs))
        matches = {name: shape.fullmatch(name) for name in found}
        return {
            fs.unstrip_protocol(name): (
                match.groupdict().get("robot") or PurePosixPath(name).parent.name,
                match.groupdict().get("day") or _stem(name),
            )
            for name, match in matches.items()
            if match
        }
    folders: dict[str, str] = {}
    for name in found:
        folder = PurePosixPath(name).parent
        if folders.setdefault(folder.name, str(folder)) != str(folder):
            raise FleetError(
                f"two robots are called {folder.name} ({folders[folder.name]} and {folder}); name them apart "
                "with {robot} in the pattern or with a table"
            )
    return {fs.unstrip_protocol(name): (PurePosixPath(name).parent.name, _stem(name)) for name in found}


def path_of(pattern: str, fs: Any) -> str:
    """A pattern as its file system names paths, its fields left in."""
    return str(fs._strip_protocol(pattern))


def _expression(path: str) -> re.Pattern[str]:
    """A path with fields and wildcards as a regular expression."""
    out = ""
    for part in re.split(r"(\{\w+\}|\*\*|\*|\?)", path):
        if part.startswith("{"):
            out += f"(?P<{part[1:-1]}>[^/]+?)"
        else:
            out += {"**": ".*", "*": "[^/]*", "?": "[^/]"}.get(part, re.escape(part))
    return re.compile(out)


def _stem(name: str) -> str:
    """run7 of run7.parquet and of run7.ident.parquet."""
    its = PurePosixPath(name).name
    for ending in (".ident.parquet", *(e for endings in ENDINGS.values() for e in endings)):
        if its.lower().endswith(ending):
            return its[: -len(ending)]
    return its


def _of_table(table: str) -> dict[str, tuple[str, str]]:
    with _reached(table):
        fs, path = _filesystem(table)
        text = fs.cat_file(path).decode("utf-8-sig", "replace")
    rows = list(csv.DictReader(io.StringIO(text)))
    if not rows or not {"file", "robot"} <= set(rows[0]):
        raise FleetError(f"{shortened(table)} has no columns file and robot; write them in its first line")
    out: dict[str, tuple[str, str]] = {}
    for number, row in enumerate(rows, 2):
        file, robot = (row["file"] or "").strip(), (row["robot"] or "").strip()
        if not file or not robot:
            raise FleetError(f"{shortened(table)}: line {number} lacks a file or a robot; fill it in")
        url = file if "://" in file or file.startswith("/") else f"{path.rpartition('/')[0]}/{file}"
        url = url if "://" in url else fs.unstrip_protocol(url)
        if url in out:
            raise FleetError(f"{shortened(table)}: line {number}: {shortened(file)} is there twice")
        out[url] = robot, (row.get("day") or "").strip() or _stem(file)
    return out


def _key(url: str, settings: str) -> str:
    """What a result depends on: address, size, time or tag of the file, and the settings."""
    state: Mapping[str, Any] = {}
    try:
        fs, path = _filesystem(url)
        state = fs.info(path)
    except Exception:  # the job itself tells why it cannot be read
        pass
    known = [str(state.get(name, "")) for name in ("size", "mtime", "ETag", "etag", "LastModified")]
    return hashlib.sha256("\n".join([url, *known, settings]).encode()).hexdigest()


def _filesystem(url: str) -> tuple[Any, str]:
    import fsspec

    return fsspec.core.url_to_fs(url)  # type: ignore[no-any-return]


class _reached:
    """Whatever a file system raises as one sentence."""

    def __init__(self, url: str) -> None:
        self.url = url

    def __enter__(self) -> None:
        return None

    def __exit__(self, _: Any, error: BaseException | None, __: Any) -> None:
        if isinstance(error, Exception) and not isinstance(error, IdentError):
            raise FleetError(unreachable(self.url, error)) from None


def unreachable(url: str, error: Exception) -> str:
    """Why an address cannot be read, and what to do."""
    if isinstance(error, ImportError):
        return f"{shortened(url)} needs a package that is missing ({error}); pip install 'dynident[fleet]'"
    if isinstance(error, FileNotFoundError):
        return f"{shortened(url)} is not there; check the address"
    reason = shortened(" ".join(str(error).split()), 160) or type(error).__name__
    return f"{shortened(url)} cannot be read ({reason}); check the address and the permission to read it"


def robots_of(jobs: Sequence[Job]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(job.robot for job in jobs))
