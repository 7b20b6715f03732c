"""Mutated studies: read from a file, with every value that the rest of the program asks of them."""

from __future__ import annotations

import copy
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from ident.recordings.study import FilterSettings, RecordingEntry, Study, load_study
from tests.reliability.judge import Case
from tests.reliability.mutations import Planted, Tree, mutated, text_of

CHUNK = 500
PLAIN: Tree = {
    "robot": "kuka_lwr4p",
    "model": "A",
    "recordings": [
        {"file": "run1.parquet", "use": "identify"},
        {"file": "run2.csv", "use": "identify", "payload": "L", "from": 1.0, "to": 50, "name": "loaded"},
        {"file": "run3.npz", "use": "validate", "rate_hz": 500, "columns": {"q2": "position_2"}},
    ],
    "filter": {"position_cutoff_hz": 10, "decimation_cutoff_hz": 0.8},
}
FULL: Tree = PLAIN | {
    "model": "C",
    "filter": {"position_cutoff_hz": 20, "decimation_cutoff_hz": "auto", "sign_cutoff_hz": 40, "order": 4,
               "sign_velocity": 0.02, "resample_hz": 500},
    "drive_gains": [1.2, 1.1, 1.0, 0.9, 0.8, 0.7, 0.6],
    "columns": {"q1": {"column": 1, "scale": 0.0174533, "offset": 0.1, "sign": -1}, "i2": 4, "t": "time"},
    "without": ["coulomb_friction:2", "offset"],
    "effects": ["stribeck_friction:2", {"effect": "torque_ripple", "joint": 4, "wavenumber": 200,
                                        "fixed": ["wavenumber"]}],
    "gravity": [0, 0, -9.81],
    "channels": ["tau_m1", "tau_m2"],
    "payload_mass": {"L": 4.6},
    "coupled_drives": [[5, 6]],
    "positions": "joint",
    "stiffness": [1e4] * 7,
    "estimator": "wls",
    "alpha": 0.01,
    "folder": "${DATA:-data}",
}  # fmt: skip


@cache
def _folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="reliability-"))


def trial(data: bytes) -> None:
    """Read a study and ask it for what every command asks it for."""
    path = _folder() / "study.yaml"
    path.write_bytes(data)
    study = load_study(path)
    study.remarks, study.robot_source, study.payloads  # noqa: B018
    for entry in study.recordings:
        study.recording_path(entry)


def _set(*way: Any) -> Any:
    *keys, value = way

    def change(tree: Tree) -> None:
        place: Any = tree
        for key in keys[:-1]:
            place = place.setdefault(key, {}) if isinstance(place, dict) else place[key]
        place[keys[-1]] = copy.deepcopy(value)

    return change


def _twice(tree: Tree) -> bytes:
    return text_of(tree)[:-1] + b', "model": "B"}'


PLANTED: Planted = (
    ("model twice", _twice),
    ("an alias", lambda tree: b"robot: &a ur10e\nmodel: *a\n"),
    ("column scale 0", _set("columns", "q1", {"column": "q1", "scale": 0})),
    ("torque from a position", _set("columns", "tau_m3", "q3")),
    ("one column for two joints", lambda tree: tree.update(columns={"q1": 1, "q2": 1})),
    ("gain zero", _set("drive_gains", [1.0, 0.0, 1, 1, 1, 1, 1])),
    ("gain negative", _set("drive_gains", [-1.0] * 7)),
    ("no gains", _set("drive_gains", [])),
    ("decimation of 1e-6 Hz", _set("filter", "decimation_cutoff_hz", 1e-6)),
    ("resampling at 1 GHz", _set("filter", "resample_hz", 1e9)),
    ("order true", _set("filter", "order", True)),
    ("a list for a number", _set("filter", "position_cutoff_hz", [10])),
    ("NaN for a cut-off", _set("filter", "position_cutoff_hz", float("nan"))),
    ("sign velocity beyond all", _set("filter", "sign_velocity", 1e6)),
    ("window of no length", lambda tree: tree["recordings"][0].update({"from": 3, "to": 3})),
    ("payload that is a mapping", lambda tree: tree["recordings"][0].update(payload={"M": 0})),
    ("payload that reads as a first moment", lambda tree: tree["recordings"][0].update(payload="X1")),
    ("a name of 5,000 characters", lambda tree: tree["recordings"][0].update(name="n" * 5000)),
    ("a path with a null", lambda tree: tree["recordings"][0].update(file="a\0b")),
    ("gravity in mm/s^2", _set("gravity", [0, 0, -9810])),
    ("gravity in g", _set("gravity", [0, 0, -1])),
    ("unknown key", _set("modell", "A")),
    ("unknown key of a recording", lambda tree: tree["recordings"][0].update(usr="identify")),
    ("nothing to identify", lambda tree: tree.update(recordings=[{"file": "a.csv", "use": "test"}])),
    ("no recordings", _set("recordings", [])),
    ("one name for two", lambda tree: tree["recordings"].append(dict(tree["recordings"][0]))),
    ("a term that none knows", _set("without", ["gravity"])),
    ("mass of nothing", lambda tree: tree.update(payload_mass={"M": 0})),
    ("an unset variable", _set("folder", "${NO_SUCH_VARIABLE}/data")),
)


def cases() -> st.SearchStrategy[Case]:
    """Mutated studies."""
    keys = {*Study.model_fields, *RecordingEntry.model_fields, *FilterSettings.model_fields, "from", "to"}
    return mutated(bases, lambda: PLANTED, sorted(keys))


def bases() -> tuple[Tree, ...]:
    """A plain study, and one with every key."""
    return PLAIN, FULL
