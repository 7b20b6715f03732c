"""Peak memory and time of `ident diagnose`, each study in a process of its own.

    python benchmarks/diagnose_memory.py [--folder DIR] [--cases minute,ten_minutes,hour,...] [--memory 2GB]

Recordings of seven joints (kuka_lwr4p) at 1 kHz: two runs, one fitted and one judging, of a minute, ten
minutes and an hour; a hundred runs of a minute; a minute before and after a pause of an hour; and a chain of
thirty joints for a minute. Made once in DIR, where they stay.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from child import measured

from ident.twin.study import PlannedRun, simulate

ROBOT = "kuka_lwr4p"
JOINTS = 30
PAUSE_S = 3600.0


def made(folder: Path, runs: Sequence[PlannedRun], robot: str | Path = ROBOT) -> Path:
    """A study of simulated runs, one simulated at a time."""
    study = folder / "study.yaml"
    if study.exists():
        return study
    folder.mkdir(parents=True, exist_ok=True)
    for run in runs:
        file = folder / f"{run.label}.parquet"
        if not file.exists():
            columns = dict(simulate(robot, runs=(run,), seed=1).recordings[0].columns)
            pq.write_table(pa.table(columns), folder / "half.parquet")
            (folder / "half.parquet").replace(file)
    entries = [{"file": f"{run.label}.parquet", "use": run.use} for run in runs]
    text = yaml.safe_dump({"robot": str(robot), "model": "A", "recordings": entries}, sort_keys=False)
    study.write_text(text)
    return study


def pair(seconds: float) -> tuple[PlannedRun, PlannedRun]:
    return PlannedRun("fitted", "identify", seconds), PlannedRun("judging", "validate", seconds)


def hundred(folder: Path) -> Path:
    return made(
        folder, [PlannedRun(f"run{k}", "validate" if k % 4 == 3 else "identify", 60.0) for k in range(100)]
    )


def paused(folder: Path) -> Path:
    """The study of a minute with an hour without rows in the middle of both runs."""
    study = made(folder, pair(60.0))
    if not (folder / "paused").exists():
        for run in pair(60.0):
            table = pq.read_table(folder / f"{run.label}.parquet")
            t = table["t"].to_numpy()
            later = pa.array(t + np.where(np.arange(len(t)) >= len(t) // 2, PAUSE_S, 0.0))
            pq.write_table(table.set_column(0, "t", later), folder / f"{run.label}.parquet")
        (folder / "paused").touch()
    return study


def chain(folder: Path) -> Path:
    """A minute of thirty joints."""
    folder.mkdir(parents=True, exist_ok=True)
    robot = folder / "robot.yaml"
    links = [
        {"joint": "revolute", "antecedent": j, "alpha": ("0", "pi/2", "-pi/2")[j % 3], "d": 0.05 * (j % 2),
         "theta": f"q{j + 1}", "r": 0.1 if j % 3 else 0}
        for j in range(JOINTS)
    ]  # fmt: skip
    robot.write_text(
        yaml.safe_dump({"name": "chain30", "convention": "mdh", "gravity": [0, 0, -9.81], "links": links})
    )
    return made(folder, pair(60.0), robot)


CASES: dict[str, tuple[Callable[[Path], Path], float]] = {  # case: study, most it may take in GB
    "minute": (lambda folder: made(folder, pair(60.0)), 0.8),
    "ten_minutes": (lambda folder: made(folder, pair(600.0)), 1.2),
    "hour": (lambda folder: made(folder, pair(3600.0)), 1.5),
    "hundred_runs": (hundred, 1.5),
    "pause": (paused, 0.8),
    "thirty_joints": (chain, 4.0),
}


def diagnosed(study: Path, memory: str | None) -> tuple[float, float, float]:
    """GB at the peak, wall and processor time in seconds; SystemExit with what a failed command said."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "ident", "diagnose", str(study), "-o", out, "--overwrite"]
        wall, cpu, peak = measured(command + (["--memory", memory] if memory else []), 1)
        return peak * 1.048576e-3, wall, cpu


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "diagnose_memory")
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--memory", default=None)
    args = parser.parse_args()
    print(f"{'case':14s} {'GB':>6s} {'limit':>6s} {'wall s':>7s} {'CPU s':>7s}")
    for name in args.cases.split(","):
        make, most = CASES[name]
        study = make(args.folder / name)
        peak, wall, cpu = diagnosed(study, args.memory)
        print(f"{name:14s} {peak:6.2f} {most:6.1f} {wall:7.1f} {cpu:7.1f}", flush=True)


if __name__ == "__main__":
    main()
