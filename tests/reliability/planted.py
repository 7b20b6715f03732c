"""Everyday defects of random size, joint and row in recordings of a simulated arm: each must be named.

`benchmarks/examination.py` plants the same kinds, each at its usual size, in measured robots.
"""

from __future__ import annotations

import json
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from hypothesis import strategies as st

from ident.equations.prepared import prepare_study
from ident.errors import IdentError
from ident.examination.examine import examine_fit, examine_tables
from ident.recordings.study import Study, load_study
from tests.reliability.judge import Case

CHUNK = 100
HANG_S = 60
JOINTS, RATE, SECONDS = 3, 200.0, 15.0
Columns = dict[str, np.ndarray]
Rng = np.random.Generator


@dataclass(frozen=True, slots=True)
class Planted:
    """A defect by its name, and the seed of its size, joint and row."""

    defect: str
    seed: int


@dataclass(frozen=True, slots=True)
class Defect:
    """Checks of which one must name it; what is done to a table (columns, number of a joint, random numbers),
    or to the study."""

    named: tuple[str, ...]
    table: Callable[[Columns, int, Rng], None] | None = None
    study: Callable[[Study, Rng], Study] | None = None


def _time(factor: float) -> Callable[[Columns, int, Rng], None]:
    def change(c: Columns, j: int, rng: Rng) -> None:
        c["t"] *= factor

    return change


def _clock(c: Columns, j: int, rng: Rng) -> None:
    c["t"] *= rng.uniform(1.5, 20) ** rng.choice([-1, 1])


def _off(c: Columns, j: int, rng: Rng) -> None:
    c["t"] *= 1 + rng.uniform(0.03, 0.2) * rng.choice([-1, 1])


def _velocities(c: Columns, j: int, rng: Rng) -> None:
    for k in range(1, JOINTS + 1):
        c[f"dq{k}"] = np.degrees(c[f"dq{k}"])


def _motor_velocity(c: Columns, j: int, rng: Rng) -> None:
    c[f"dq{j}"] *= rng.uniform(10, 200)


def _degrees(c: Columns, j: int, rng: Rng) -> None:
    for k in range(1, JOINTS + 1):
        c[f"q{k}"], c[f"dq{k}"] = np.degrees(c[f"q{k}"]), np.degrees(c[f"dq{k}"])


def _counts(c: Columns, j: int, rng: Rng) -> None:
    c[f"q{j}"] = np.rint(c[f"q{j}"] * 2 ** rng.integers(13, 24))


def _wrap(c: Columns, j: int, rng: Rng) -> None:
    at = np.quantile(c[f"q{j}"], rng.uniform(0.2, 0.8))
    c[f"q{j}"] = (c[f"q{j}"] - at) % (2 * np.pi)


def _spikes(share: float) -> Callable[[Columns, int, Rng], None]:
    def change(c: Columns, j: int, rng: Rng) -> None:
        name = f"{rng.choice(['q', 'tau_m'])}{j}"
        x = c[name]
        few = rng.integers(1, 6)
        rows = rng.choice(
            np.arange(20, len(x) - 20), few if not share else int(share * len(x)), replace=False
        )
        size = rng.uniform(0.1, 3) if name[0] == "q" else rng.uniform(3, 100) * np.ptp(x)
        x[rows] += size * rng.choice([-1, 1])

    return change


def _run(x: np.ndarray, rng: Rng, length: int) -> slice:
    start = int(rng.integers(50, len(x) - length - 50))
    return slice(start, start + length)


def _empty(c: Columns, j: int, rng: Rng) -> None:
    x = c[f"{rng.choice(['q', 'tau_m'])}{j}"]
    x[_run(x, rng, int(rng.integers(1, 400)))] = np.nan


def _marks(c: Columns, j: int, rng: Rng) -> None:
    x = c[f"tau_m{j}"]
    x[_run(x, rng, int(rng.integers(1, 30)))] = rng.choice([9999.0, -9999.0, 1e300, 32767.0, 99999.0])


def _cut(c: Columns, j: int, rng: Rng) -> None:
    for name in (f"tau_m{j}", *rng.permutation([n for n in c if n[0] == "q"])[: rng.integers(0, 3)]):
        c[name][-1] = np.nan


def _frozen(c: Columns, j: int, rng: Rng) -> None:
    rows = _run(c["t"], rng, int(rng.integers(60, 140)))
    for name in c:
        if name != "t":
            c[name][rows] = c[name][rows.start]


def _bursts(c: Columns, j: int, rng: Rng) -> None:
    k, size = np.arange(len(c["t"])), int(rng.integers(5, 40))
    c["t"] = np.minimum(k // size * size + size - 1, len(k) - 1) / RATE


def _leap(c: Columns, j: int, rng: Rng) -> None:
    c["t"] += rng.uniform(1, 1e4) * (np.arange(len(c["t"])) >= rng.integers(200, len(c["t"]) - 200))


def _sign(c: Columns, j: int, rng: Rng) -> None:
    c[f"tau_m{j}"] *= -1


def _all_signs(c: Columns, j: int, rng: Rng) -> None:
    for k in range(1, JOINTS + 1):
        c[f"tau_m{k}"] *= -1


def _scale(c: Columns, j: int, rng: Rng) -> None:
    """Not of the first joint: an upright axis shares next to nothing with the others, and any scale fits."""
    c[f"tau_m{rng.integers(2, JOINTS + 1)}"] *= rng.choice(
        [1e3, 1e-3, rng.uniform(3.5, 200), 1 / rng.uniform(3.5, 200)]
    )


def _dead(c: Columns, j: int, rng: Rng) -> None:
    c[f"tau_m{j}"] = np.full(len(c["t"]), rng.choice([0.0, rng.normal()]))


def _noise(c: Columns, j: int, rng: Rng) -> None:
    c[f"tau_m{j}"] = rng.normal(rng.normal(), 10 ** rng.uniform(-3, 1), len(c["t"]))


def _all_dead(c: Columns, j: int, rng: Rng) -> None:
    for k in range(1, JOINTS + 1):
        _dead(c, k, rng)


def _switch(c: Columns, j: int, rng: Rng) -> None:
    c[f"tau_m{j}"] = (c[f"tau_m{j}"] > np.median(c[f"tau_m{j}"])).astype(float)


def _clip(c: Columns, j: int, rng: Rng) -> None:
    x = c[f"tau_m{j}"]
    c[f"tau_m{j}"] = np.clip(x, None, np.quantile(x, rng.uniform(0.7, 0.9)))


def _step(c: Columns, j: int, rng: Rng) -> None:
    c[f"q{j}"] += rng.uniform(0.1, 2) * (np.arange(len(c["t"])) >= rng.integers(200, len(c["t"]) - 200))


def _rest(c: Columns, j: int, rng: Rng) -> None:
    c[f"q{j}"] = np.full(len(c["t"]), rng.uniform(-1, 1))
    c[f"dq{j}"] = np.zeros(len(c["t"]))


def _swap(c: Columns, j: int, rng: Rng) -> None:
    c["tau_m2"], c["tau_m3"] = c["tau_m3"], c["tau_m2"]


def _other_run(c: Columns, j: int, rng: Rng) -> None:
    rows = int(rng.integers(300, len(c["t"]) - 300))
    for k in range(1, JOINTS + 1):
        for name in (f"q{k}", f"dq{k}"):
            c[name] = np.roll(c[name], rows)[::-1].copy()


def _wall(study: Study, rng: Rng) -> Study:
    """The file says so; the arm stands on the floor."""
    axis = rng.normal(size=3) * [1, 1, 0.2]
    return study.with_(gravity=tuple((9.81 * axis / np.linalg.norm(axis)).tolist()))


DEFECTS = {
    "time in ms": Defect(("time_unit",), _time(1e3)),
    "time in us": Defect(("time_unit",), _time(1e6)),
    "time in ns": Defect(("time_unit",), _time(1e9)),
    "clock too fast or slow": Defect(("clock_rate", "time_unit"), _clock),
    "clock a little off": Defect(("clock_rate",), _off),
    "velocities in degrees": Defect(("clock_rate",), _velocities),
    "a velocity of the motor's side": Defect(("clock_rate",), _motor_velocity),
    "positions in degrees": Defect(("angle_unit",), _degrees),
    "a position in counts": Defect(("angle_unit", "clock_rate"), _counts),
    "wrap": Defect(("wrap",), _wrap),
    "spikes": Defect(("spike",), _spikes(0.0)),
    "many spikes": Defect(("spike", "missing_values"), _spikes(0.03)),
    "empty cells": Defect(("missing_values",), _empty),
    "a logger's marks": Defect(("missing_values", "spike"), _marks),
    "a last row cut": Defect(("truncated",), _cut),
    "a logger that stands still": Defect(("frozen", "clock_rate"), _frozen),
    "stamps in bursts": Defect(("time_stamps",), _bursts),
    "a clock that leaps": Defect(("time_stamps",), _leap),
    "a torque with the other sign": Defect(("torque_sign",), _sign),
    "all torques with the other sign": Defect(("torque_sign",), _all_signs),
    "a torque of another scale": Defect(("torque_scale",), _scale),
    "a dead torque": Defect(("dead_channel",), _dead),
    "a dead torque under noise": Defect(("dead_channel",), _noise),
    "all torques dead": Defect(("dead_channel",), _all_dead),
    "a switch for a torque": Defect(("flag_column",), _switch),
    "a clipped torque": Defect(("saturation",), _clip),
    "a position that leaps": Defect(("position_step", "wrap"), _step),
    "a joint at rest": Defect(("resting_joint",), _rest),
    "two torques exchanged": Defect(("swapped_signals",), _swap),
    "positions of another run": Defect(("wrong_robot", "unrelated_torque", "clock_rate"), _other_run),
    "gravity elsewhere": Defect(("base_orientation",), study=_wall),
}


def _truth() -> dict[str, float]:
    """An arm of 17 kg: every torque stands well above its noise."""
    from ident.twin.parameters import body

    found: dict[str, float] = {}
    for j, (mass, along) in enumerate(((8.0, 0.05), (6.0, 0.2), (3.0, 0.15)), 1):
        its = body(mass, np.array([along, 0.02, 0.03]), 0.02 * mass * np.diag([0.3, 1.0, 0.8]))
        found |= {f"{name}{j}": float(value) for name, value in its.items()}
        found |= {f"Iam{j}": 0.1 * mass, f"Fvm{j}": 0.8 * mass, f"Fcm{j}": 0.6 * mass}
    return found


@cache
def _simulated() -> tuple[Path, dict[str, Columns]]:
    """A folder with a study, and the columns of its recordings; read only."""
    from small_arm import ARM

    from ident.twin import PlannedRun, Sensors, simulate, write_simulation

    folder = Path(tempfile.mkdtemp(prefix="reliability-"))
    (folder / "small.yaml").write_text(ARM)
    (folder / "truth.yaml").write_text(json.dumps(_truth()))
    runs = tuple(PlannedRun(use, use, SECONDS) for use in ("identify", "validate"))
    made = simulate(
        str(folder / "small.yaml"),
        "A",
        parameters=folder / "truth.yaml",
        runs=runs,
        sensors=Sensors(RATE, 2 * np.pi / 2**19, 1.0),
    )
    write_simulation(made, folder / "out")
    tables = {}
    for path in sorted((folder / "out").glob("*.parquet")):
        table = pq.read_table(path)
        tables[path.name] = {n: table[n].to_numpy().astype(float) for n in table.column_names}
        for j in range(1, JOINTS + 1):
            tables[path.name][f"dq{j}"] = np.gradient(tables[path.name][f"q{j}"], 1 / RATE)
    return folder / "out", tables


class Named(Exception):
    """The planted defect is among what was said."""

    exit_status = 2


def trial(planted: Planted) -> None:
    """Raises Named, or returns; what else is raised is judged as anywhere."""
    folder, tables = _simulated()
    defect, rng = DEFECTS[planted.defect], np.random.default_rng(planted.seed)
    joint = int(rng.integers(1, JOINTS + 1))
    place = Path(tempfile.mkdtemp(prefix="reliability-"))
    study = load_study(folder / "study.yaml").with_(folder=str(place))
    state = rng.bit_generator.state
    for name, columns in tables.items():
        changed = {key: values.copy() for key, values in columns.items()}
        rng.bit_generator.state = state  # the same in every recording
        if defect.table is not None:
            defect.table(changed, joint, rng)
        pq.write_table(pa.table(changed), place / name)
    if defect.study is not None:
        study = defect.study(study, rng)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            prepared = prepare_study(study)
            checks = [*examine_tables(prepared), *examine_fit(prepared)]
        except IdentError as error:
            checks = list(getattr(error, "checks", ()))
            if not checks:
                raise
    if any(check.check in defect.named for check in checks):
        raise Named(f"{planted.defect} is named")


def cases() -> st.SearchStrategy[Case]:
    """A defect and a seed."""
    drawn: Any = st.builds(Planted, st.sampled_from(sorted(DEFECTS)), st.integers(0, 2**32 - 1))
    return drawn.map(lambda planted: Case(planted, planted.defect))
