"""Studies for Python: recordings that are files or tables in memory, and the study file itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ident.errors import StudyError
from ident.recordings import study as room
from ident.recordings.study import RecordingEntry


class Recording(RecordingEntry):
    """One run: a path, a data frame, an Arrow table or a dict of arrays, and its use.

    Columns as in a recording file: t [s], q1.. [rad|m], tau_m1.. or i1.., tau_l1.. [N m|N]; a dict's (N, n)
    array q stands for q1..qn. Other names, scales, offsets and signs through `columns`. `use`: identify,
    validate or test. Further keys as in a study file: payload, name, rate_hz, decimal, from_s, to_s.
    """

    def __init__(self, data: Any = None, use: str = "identify", **keys: Any) -> None:
        if data is None:
            data = keys.pop("file", None)
        in_memory = not isinstance(data, str | Path)
        name = keys.pop("name", None)
        file = (name or "a table") if in_memory else str(data)
        try:
            super().__init__(file=file, use=use, name=name, **keys)  # type: ignore[arg-type]
        except ValidationError as error:
            raise room.as_study_error(error, Path(file)) from None
        if in_memory:
            self._table = data

    def __repr__(self) -> str:
        return f"Recording({self.label!r}, use={self.use!r})"


class Study(room.Study):
    """What is identified from which runs; keys as in a study file (see `ident.recordings.study.Study`).

    ident.Study(robot="ur10e", recordings=[ident.Recording(df), ident.Recording("b.csv", "validate")])
    """

    def __init__(self, robot: Any = None, recordings: Sequence[Any] | None = None, **keys: Any) -> None:
        given = {"robot": str(robot) if isinstance(robot, Path) else robot, "recordings": recordings}
        keys |= {key: value for key, value in given.items() if value is not None}
        if isinstance(keys.get("recordings"), list | tuple):
            keys["recordings"] = tuple(_named(item, k) for k, item in enumerate(keys["recordings"], 1))
        checked = room.study_from(keys, Path(keys.pop("file", "the study")))
        super().__init__(**{name: getattr(checked, name) for name in room.Study.model_fields})

    def __repr__(self) -> str:
        runs = len(self.recordings)
        return f"Study({self.robot!r}, model={self.model!r}, {runs} recording{'s' if runs != 1 else ''})"

    def __str__(self) -> str:
        lines = [f"{self.robot}, model {self.model}"]
        lines += [
            f"  {entry.label:<20} {entry.use:<9}{f' payload {entry.payload}' if entry.payload else ''}"
            for entry in self.recordings
        ]
        return "\n".join(line.rstrip() for line in lines)


def _named(item: Any, number: int) -> Any:
    """A table in memory gets a name: run1, run2, ... by its place; paths and tables alone are recordings."""
    if isinstance(item, Mapping) and ("file" in item or not _is_table(item)):
        return item
    entry = item if isinstance(item, RecordingEntry) else Recording(item)
    if entry.table is None or entry.name is not None:
        return entry
    return entry.model_copy(update={"name": f"run{number}", "file": f"run{number}"})


def _is_table(item: Mapping[Any, Any]) -> bool:
    return any(not isinstance(value, str | int | float | Mapping) for value in item.values())


def load(path: str | Path) -> Study:
    """Read a study file. Raises ident.Error: one sentence with the file, the key and the remedy."""
    return opened(room.load_study(path))


def opened(study: Any) -> Study:
    """A `Study` of the door from a path or from a study of the inner rooms."""
    if isinstance(study, Study):
        return study
    if isinstance(study, str | Path):
        return load(study)
    if isinstance(study, room.Study):
        return Study(**{name: getattr(study, name) for name in room.Study.model_fields})
    raise StudyError("the study", "", f"is {type(study).__name__}; give ident.Study or the path of a study")


def inputs_of(study: room.Study) -> list[Path]:
    """The files that a study is made of; none is ever written to."""
    files = [study.recording_path(entry) for entry in study.recordings if entry.table is None]
    return [study.file, Path(study.robot_source), *files]
