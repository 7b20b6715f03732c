"""Time and memory of a command in a process of its own."""

from __future__ import annotations

import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Sequence


def measured(command: Sequence[str], repeat: int) -> tuple[float, float, float]:
    """Median wall and CPU time [s], largest resident set [MB]; SystemExit with what it said."""
    wall, cpu, peak = [], [], []
    for _ in range(repeat):
        with tempfile.TemporaryFile() as said:  # a pipe that nobody reads would hold the command up
            start = time.perf_counter()
            child = subprocess.Popen(command, stdout=said, stderr=subprocess.STDOUT)
            _, status, usage = os.wait4(child.pid, 0)
            wall.append(time.perf_counter() - start)
            if status:
                said.seek(0)
                raise SystemExit(f"{' '.join(command[:4])} failed: {said.read().decode()[-2000:]}")
        cpu.append(usage.ru_utime + usage.ru_stime)
        peak.append(usage.ru_maxrss / 1024)
    return statistics.median(wall), statistics.median(cpu), max(peak)
