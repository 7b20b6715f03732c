"""What a worker does: one recording in, its summary (or the reason why not) out. Nothing is written here."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from ident.fleet.jobs import Job, unreachable
from modelgen.errors import shortened

ENDS = (KeyboardInterrupt, SystemExit, MemoryError)


@dataclass(frozen=True, slots=True)
class Done:
    """The file of a summary, or the reason why there is none."""

    data: bytes = b""
    reason: str = ""


def summarised(job: Job, keys: Mapping[str, Any], folder: str) -> Done:
    """The summary of one recording; `keys` of its study beside the recording, paths from `folder`."""
    from ident.summaries.file import ENDING, Summary, read, written
    from ident.summaries.make import summarise

    def work(path: Path) -> Done:
        if path.name.endswith(ENDING):
            kept = read(path.read_bytes(), job.url)
            return Done(written(Summary(kept.header, kept.windows)))
        return Done(written(summarise(study_of(path, keys, folder), job.key)))

    return _with_file(job, work)


def diagnosed(job: Job, keys: Mapping[str, Any], folder: str) -> Done:
    """What a diagnosis of one recording finds, as lines of text."""
    import ident

    def work(path: Path) -> Done:
        document = ident.diagnose(study_of(path, keys, folder), progress=False).document()
        found = [f"{f['effect']}:{','.join(map(str, f['joints']))}".rstrip(":") for f in document["findings"]]
        return Done("\n".join(found or [document["verdict"]]).encode())

    return _with_file(job, work)


def study_of(path: Path, keys: Mapping[str, Any], folder: str) -> Any:
    """The study of one recording."""
    from ident.recordings.study import study_from

    entry = {"file": str(path), "use": "identify"}
    return study_from({**keys, "recordings": [entry]}, Path(folder) / "the study of the fleet")


def _with_file(job: Job, work: Any) -> Done:
    import fsspec

    try:
        fs, path = fsspec.core.url_to_fs(job.url)
        if "file" in (fs.protocol if isinstance(fs.protocol, tuple) else (fs.protocol,)):
            return work(Path(path))
        with tempfile.TemporaryDirectory(prefix="ident-fleet-") as here:
            copy = Path(here) / PurePosixPath(path).name
            fs.get_file(path, str(copy))
            return work(copy)
    except ENDS:
        raise
    except Exception as error:
        if hasattr(error, "exit_status"):
            return Done(reason=str(error))
        if isinstance(error, OSError | ImportError) or "botocore" in type(error).__module__:
            return Done(reason=unreachable(job.url, error))
        text = f"{type(error).__name__}: {shortened(str(error), 160)}"
        return Done(reason=f"{shortened(job.url)}: our mistake, {text}; please report it")
