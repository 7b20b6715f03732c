"""`ident fleet` on one Dask worker, on two, on two one of which is killed: time, and whether a bit differs.

    python benchmarks/fleet_workers.py [--studies 64] [--seconds 90]

Needs the `fleet` extra and two cores that nobody else uses. Scheduler and workers are processes on loopback;
the time is that of the whole command, from a warm cluster on. Each recording is the same motion of the
paper's robot with noise of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ident.twin.study import PlannedRun, simulate

ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": ENVIRONMENT}
WARM = "import ident.summaries.make, ident.summaries.file"


def logs(folder: Path, studies: int, seconds: float) -> None:
    """FOLDER/robotNN/dayNN.parquet, eight robots."""
    run = simulate("kuka_lwr4p", "A", runs=(PlannedRun("run1", "identify", seconds, 44),)).recordings[0]
    rng = np.random.default_rng(0)
    for k in range(studies):
        noisy = {
            name: x + rng.normal(size=len(x)) * (0.1 if name.startswith("tau") else 0.0)
            for name, x in run.columns.items()
        }
        place = folder / f"robot{k % 8:02d}" / f"day{k // 8:02d}.parquet"
        place.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(pa.table(noisy), place)


@contextmanager
def cluster(workers: int, folder: Path) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """The scheduler's address and the workers' processes."""
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    python = [sys.executable, "-m"]
    ask = ["--host", "127.0.0.1", "--scheduler-file", str(file), "--no-dashboard"]
    running = [subprocess.Popen([*python, "distributed.cli.dask_scheduler", "--port", "0", *ask], **QUIET)]
    try:
        while not file.exists() or not file.read_text():
            time.sleep(0.1)
        ask += ["--nthreads", "1", "--no-nanny", "--local-directory", str(folder)]
        running += [
            subprocess.Popen([*python, "distributed.cli.dask_worker", *ask], **QUIET) for _ in range(workers)
        ]
        address = json.loads(file.read_text())["address"]
        from distributed import Client

        with Client(address) as client:
            client.wait_for_workers(workers)
            client.run(exec, WARM)
        yield address, running[1:]
    finally:
        for process in reversed(running):
            process.kill()
            process.wait()


def night(pattern: str, out: Path, address: str | None, kill: subprocess.Popen | None = None) -> float:
    """Seconds that `ident fleet` takes; `kill` dies when the first summary is there."""
    command = [sys.executable, "-m", "ident.command_line.cli", "fleet", pattern, "-o", str(out)]
    command += ["--robot", "kuka_lwr4p", "--no-diagnose"]
    start = time.perf_counter()
    done = subprocess.Popen(command + (["--scheduler", address] if address else []), **QUIET)
    while kill is not None and done.poll() is None and not list(out.glob("summaries/*/*")):
        time.sleep(0.05)
    if kill is not None:
        kill.send_signal(signal.SIGKILL)
    if done.wait():
        raise SystemExit(f"ident fleet ended with status {done.returncode}")
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--studies", type=int, default=64)
    parser.add_argument("--seconds", type=float, default=90.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs(folder / "logs", options.studies, options.seconds)
        pattern, spent = f"{folder}/logs/{{robot}}/{{day}}.parquet", {}
        tables = {}
        for label, workers in (("one worker", 1), ("two workers", 2), ("two, one killed", 2)):
            out = folder / label.replace(" ", "_").replace(",", "")
            with cluster(workers, folder) as (address, running):
                spent[label] = night(pattern, out, address, running[0] if "killed" in label else None)
            tables[label] = (out / "fleet.parquet").read_bytes()
            same = "the same table" if tables[label] == tables["one worker"] else "ANOTHER TABLE"
            print(
                f"{label:18}{spent[label]:8.1f} s, {spent['one worker'] / spent[label]:.2f} x, {same}; "
                f"load {os.getloadavg()[0]:.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
