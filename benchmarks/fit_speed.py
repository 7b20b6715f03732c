"""Time and memory of `ident fit`, whole process, and how they grow with length, joints and files.

    python benchmarks/fit_speed.py [--grow length,joints,files,two] [--most 36000] [--repeat 3]

length: one run of the paper's robot at 1 kHz, model C, for 30 s, 90 s, 15 min, 1 h and 10 h (the same 90 s
again and again, a second apart; 7 GB). joints: chains of 2, 7, 15 and 30, 90 s, model A. files: 1, 8, 64 and
512 of 20 s, model A. two: two runs of 90 s, one with a payload. Decimation cut-off 0.8 Hz; results, plots and
report are written. `growth` is processor time over that of the group's second case, `size` what its data are
times those of the second: as much is proportional; memory should not grow. `data` is the same growth less
what a process takes without any data, as the first two cases have it (a line through them). One fit before
derives and compiles the model.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from child import measured

from ident.twin.study import PlannedRun, simulate
from ident.twin.writing import write_simulation

ROBOT, SECONDS, RATE_HZ = "kuka_lwr4p", 90.0, 1000.0
LENGTHS = (30, 90, 900, 3600, 36000)
JOINTS = (2, 7, 15, 30)
FILES, FILE_S = (1, 8, 64, 512), 20.0
LOADED = (
    PlannedRun("run1", "identify", SECONDS, 44),
    PlannedRun("run5", "identify", SECONDS, 44, loaded=True),
)
Case = tuple[str, float, Path]  # name, size, study


def study(folder: Path, robot: str, model: str, names: list[str]) -> Path:
    loads = {"run5.parquet": {"payload": "L"}}
    entries = [{"file": name, "use": "identify"} | loads.get(name, {}) for name in names]
    settings: dict[str, object] = {"robot": robot, "model": model, "recordings": entries}
    settings["filter"] = {"position_cutoff_hz": 10, "decimation_cutoff_hz": 0.8}
    (folder / "study.yaml").write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")
    return folder / "study.yaml"


def lengthen(source: Path, target: Path, times: float) -> None:
    """The same run `times` over, a second apart (a gap, so segments are not bridged), or a part of it."""
    table = pq.read_table(source)
    table = table.slice(0, round(min(times, 1) * len(table)))
    t = table.column("t").to_numpy()
    with pq.ParquetWriter(target, table.schema) as out:
        for k in range(max(round(times), 1)):
            shifted = pa.array(t + k * (t[-1] + 1.0))
            out.write_table(table.set_column(table.column_names.index("t"), "t", shifted))


def lengths(folder: Path, most: float) -> Iterator[Case]:
    write_simulation(simulate(ROBOT, "C", runs=LOADED[:1]), folder)
    for seconds in (s for s in LENGTHS if s <= most):
        place = folder / f"of_{seconds}"
        place.mkdir()
        lengthen(folder / "run1.parquet", place / "run1.parquet", seconds / SECONDS)
        yield f"{seconds} s", seconds, study(place, ROBOT, "C", ["run1.parquet"])


def chain(joints: int) -> str:
    """A robot file: revolute joints about axes in turn at right angles."""
    links = [
        {"joint": "revolute", "antecedent": j, "alpha": ("0", "pi/2", "-pi/2")[j % 3], "d": 0.05 * (j % 2),
         "theta": f"q{j + 1}", "r": 0.1 if j % 3 else 0}
        for j in range(joints)
    ]  # fmt: skip
    robot = {"name": f"chain{joints}", "convention": "mdh", "gravity": [0, 0, -9.81], "links": links}
    return yaml.safe_dump(robot)


def joints(folder: Path, most: float) -> Iterator[Case]:
    for n in JOINTS:
        robot = folder / f"chain{n}.yaml"
        robot.write_text(chain(n))
        place = folder / f"of_{n}"
        place.mkdir()
        run = PlannedRun("run1", "identify", SECONDS)
        columns = dict(simulate(str(robot), runs=(run,), seed=1).recordings[0].columns)
        pq.write_table(pa.table(columns), place / "run1.parquet")
        yield f"{n} joints", n, study(place, str(robot), "A", ["run1.parquet"])


def files(folder: Path, most: float) -> Iterator[Case]:
    run = PlannedRun("run", "identify", FILE_S, 10)
    columns = dict(simulate(ROBOT, "A", runs=(run,)).recordings[0].columns)
    rng, torques = np.random.default_rng(0), [name for name in columns if name.startswith("tau")]
    for n in FILES:
        place = folder / f"of_{n}"
        place.mkdir()
        names = [f"run{k}.parquet" for k in range(n)]
        for name in names:  # each with noise of its own
            own = {tau: columns[tau] + rng.normal(0, 0.05, len(columns[tau])) for tau in torques}
            pq.write_table(pa.table(columns | own), place / name)
        yield f"{n} files", n, study(place, ROBOT, "A", names)


def two(folder: Path, most: float) -> Iterator[Case]:
    write_simulation(simulate(ROBOT, "C", payload_kg=4.6136, runs=LOADED), folder)
    yield "2 x 90 s", 1, study(folder, ROBOT, "C", ["run1.parquet", "run5.parquet"])


GROUPS = {"length": lengths, "joints": joints, "files": files, "two": two}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grow", default=",".join(GROUPS))
    parser.add_argument("--most", type=float, default=max(LENGTHS), help="longest recording, s")
    parser.add_argument("--repeat", type=int, default=3, help="of the first two cases of each group")
    options = parser.parse_args()
    print(f"{'':11}{'wall s':>9}{'CPU s':>9}{'MB':>7}{'growth':>9}{'data':>8}{'size':>8}{'load':>7}")
    for group in options.grow.split(","):
        with tempfile.TemporaryDirectory() as name:
            seen: list[tuple[float, float]] = []  # size, CPU s
            for label, size, its in GROUPS[group](Path(name), options.most):
                fit = [sys.executable, "-m", "ident", "fit", str(its), "-o", str(its.parent / "out")]
                if not seen or group == "joints":  # the model is new
                    measured(fit, 1)
                wall, cpu, peak = measured(fit, options.repeat if len(seen) < 2 else 1)
                seen.append((size, cpu))
                print(
                    f"{label:11}{wall:9.2f}{cpu:9.2f}{peak:7.0f}{grown(seen)}{os.getloadavg()[0]:7.1f}",
                    flush=True,
                )


def grown(seen: list[tuple[float, float]]) -> str:
    """Processor time, the same less a process's own, and size: over those of the second case."""
    if len(seen) < 2:
        return f"{'':25}"
    (small, first), (one, second), (size, cpu) = seen[0], seen[1], seen[-1]
    own = first - (second - first) * small / (one - small)
    return f"{cpu / second:8.1f}x{(cpu - own) / (second - own):7.1f}x{size / one:7.1f}x"


if __name__ == "__main__":
    main()
