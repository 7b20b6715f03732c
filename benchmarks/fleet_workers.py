"""`ident fleet` on one Dask worker, on two, on two one of which is killed: time, and whether a bit differs.

    python benchmarks/fleet_workers.py [--studies 64] [--seconds 90] [--rounds 1]

Needs the `fleet` extra and, for the times, two cores that nobody else uses. Scheduler and workers are
processes on loopback; the time is that of the whole command, from a warm cluster on. Each recording is the
same motion of the paper's robot with noise of its own. Rounds alternate one worker and two.

Processor times say what a quiet machine would give: the command's own (C, with the scheduler's S) is spent
before, between and after the workers' (W); if none of it overlapped theirs, two workers would be
(C + S + W) / (C + S + W / 2) times as fast. `idle` is what workers did not use of the time of the command,
on a shared machine also what others took.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import child
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ident.twin.study import PlannedRun, simulate

ENVIRONMENT = child.ENVIRONMENT | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
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
    """The scheduler's address and the processes: the scheduler's, the workers'."""
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
        yield address, running
    finally:
        for process in reversed(running):
            process.kill()
            process.wait()


@dataclass(frozen=True)
class Spent:
    """Seconds of one command; processor time of itself, of the scheduler and of the workers together."""

    wall: float
    own: float
    scheduler: float
    workers: float
    count: int

    @property
    def idle(self) -> float:
        return 1 - self.workers / (self.count * self.wall)

    @property
    def quiet(self) -> float:
        """How much faster two workers would be where nothing but the workers' own runs side by side."""
        alone = self.own + self.scheduler
        return (alone + self.workers) / (alone + self.workers / 2)


def _processor(process: subprocess.Popen) -> float:
    import psutil

    try:
        times = psutil.Process(process.pid).cpu_times()
    except psutil.Error:  # killed meanwhile
        return 0.0
    return times.user + times.system


def night(
    pattern: str, out: Path, address: str, running: list[subprocess.Popen], kill: bool = False
) -> Spent:
    """What `ident fleet` takes; with `kill` the first worker dies when the first summary is there.
    running: scheduler and workers."""
    command = [sys.executable, "-m", "ident.command_line.cli", "fleet", pattern, "-o", str(out)]
    command += ["--robot", "kuka_lwr4p", "--no-diagnose"]
    before = [_processor(process) for process in running]
    start = time.perf_counter()
    done = subprocess.Popen([*command, "--scheduler", address], **QUIET)
    while kill and not list(out.glob("summaries/*/*")) and time.perf_counter() < start + 120:
        time.sleep(0.05)
    if kill:
        running[1].send_signal(signal.SIGKILL)
    _, status, usage = os.wait4(done.pid, 0)
    wall = time.perf_counter() - start
    if status:
        raise SystemExit(f"ident fleet ended with status {os.waitstatus_to_exitcode(status)}")
    after = [max(_processor(process) - used, 0.0) for process, used in zip(running, before)]
    return Spent(wall, usage.ru_utime + usage.ru_stime, after[0], sum(after[1:]), len(running) - 1)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--studies", type=int, default=64)
    parser.add_argument("--seconds", type=float, default=90.0)
    parser.add_argument("--rounds", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs(folder / "logs", options.studies, options.seconds)
        pattern = f"{folder}/logs/{{robot}}/{{day}}.parquet"
        spent: dict[str, list[float]] = {}
        table = b""
        cases = [("one worker", 1), ("two workers", 2)] * options.rounds + [("two, one killed", 2)]
        print(f"{'':18}{'wall s':>8}{'command':>9}{'scheduler':>11}{'workers':>9}{'idle':>7}{'quiet':>8}")
        for number, (label, workers) in enumerate(cases):
            out = folder / f"out{number}"
            with cluster(workers, folder) as (address, running):
                found = night(pattern, out, address, running, "killed" in label)
            spent.setdefault(label, []).append(found.wall)
            its = (out / "fleet.parquet").read_bytes()
            table = table or its
            print(
                f"{label:18}{found.wall:8.1f}{found.own:9.1f}{found.scheduler:11.1f}{found.workers:9.1f}"
                f"{100 * found.idle:6.0f}%{found.quiet:7.2f}x  {'the same' if its == table else 'ANOTHER'} "
                f"table; load {os.getloadavg()[0]:.1f}",
                flush=True,
            )
        one, two = (statistics.median(spent[label]) for label in ("one worker", "two workers"))
        print(f"two workers are {one / two:.2f} x as fast as one here")


if __name__ == "__main__":
    main()
