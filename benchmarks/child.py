"""Time and memory of a command in a process of its own, which may keep its bytecode as any Python does."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence

# A child's largest resident set is never below its parent's at the start, so a small process starts it.
STARTER = """
import json, os, subprocess, sys, time
start = time.perf_counter()
child = subprocess.Popen(sys.argv[2:], stdout=int(sys.argv[1]), stderr=subprocess.STDOUT)
_, status, usage = os.wait4(child.pid, 0)
spent = time.perf_counter() - start
print(json.dumps([status, spent, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024]))
"""
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def measured(command: Sequence[str], repeat: int) -> tuple[float, float, float]:
    """Median wall and CPU time [s], largest resident set [MB]; SystemExit with what it said."""
    found = []
    for _ in range(repeat):
        with tempfile.TemporaryFile() as said:  # a pipe that nobody reads would hold the command up
            fd = said.fileno()
            starter = [sys.executable, "-I", "-S", "-c", STARTER, str(fd), *command]
            told = subprocess.run(
                starter, stdout=subprocess.PIPE, pass_fds=[fd], check=True, env=ENVIRONMENT
            ).stdout
            status, *figures = json.loads(told)
            found.append(figures)
            if status:
                said.seek(0)
                raise SystemExit(f"{' '.join(command[:4])} failed: {said.read().decode()[-2000:]}")
    wall, cpu, peak = zip(*found)
    return statistics.median(wall), statistics.median(cpu), max(peak)
