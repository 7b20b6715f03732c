"""From a model's C to a shared library for this CPU, kept in the cache."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from generated import cache as entries
from generated import self_check

HERE = Path(__file__).parent
FLAGS = ("-std=gnu11", "-O3", "-fno-math-errno", "-ffp-contract=fast", "-fPIC", "-shared", "-w")
NATIVE = "-march=native"
LIBRARY = "kernel.so"
SECONDS = 600
CHECKED = "2"  # of a cache entry: compiled and checked by this version of the check


class NoCompilerError(Exception):
    """No C compiler that understands vector extensions was found, or it failed."""


@cache
def compilers() -> tuple[tuple[str, ...], ...]:
    """Commands to try: $CC, the system's compilers, the ziglang wheel."""
    found = []
    if os.environ.get("CC"):
        command = shlex.split(os.environ["CC"])
        if command and shutil.which(command[0]):
            found.append(tuple(command))
    for name in ("cc", "gcc", "clang"):
        path = shutil.which(name)
        if path:
            found.append((path,))
    try:
        import ziglang  # noqa: F401

        found.append((sys.executable, "-m", "ziglang", "cc"))
    except ImportError:
        pass
    return tuple(found)


def shim(description: Mapping[str, Any], model_c: str, prefix: str) -> str:
    """The translation unit: vector types, the model's C, the batch functions."""
    sizes = {
        "JOINTS": len(description["joints"]),
        "CHANNELS": len(description["channels"]),
        "ENTRIES": description["columns"],
        "EXTRAS": len(description["extra_inputs"]),
        "COLUMNS": f"{prefix}_columns",
        "TORQUE": f"{prefix}_inverse_dynamics",
    }
    defines = "".join(f"#define {name} {value}\n" for name, value in sizes.items())
    vector, batch = ((HERE / name).read_text(encoding="utf-8") for name in ("vector.h", "batch.c"))
    return f"{vector}\n{defines}\n{model_c}\n{batch}"


def library(description: Mapping[str, Any], model_c: str) -> Path:
    """The library of a model's C, from the cache if it is there; a new one must agree with NumPy first.

    Raises NoCompilerError when no compiler makes one.
    """
    text = shim(description, model_c, description["prefix"])
    reasons = []

    def build(place: Path, command: tuple[str, ...], flags: tuple[str, ...]) -> None:
        _compile(command, flags, text, place)
        wrong = self_check.problem(place / LIBRARY, description, model_c)
        if wrong:
            raise NoCompilerError(f"what {' '.join(command)} compiled {wrong}")

    for command in compilers():
        for flags in ((*FLAGS, NATIVE), FLAGS):
            name = "kernel-" + entries.key(CHECKED, text, *command, _identity(command), *flags, cpu())[:40]
            try:
                return entries.entry(name, lambda place: build(place, command, flags)) / LIBRARY  # noqa: B023
            except NoCompilerError as error:
                reasons.append(str(error))
    raise NoCompilerError(reasons[0] if reasons else "no C compiler was found")


def _compile(command: tuple[str, ...], flags: tuple[str, ...], text: str, place: Path) -> None:
    source = place / "kernel.c"
    source.write_text(text, encoding="utf-8")
    # relative names: the library must not depend on where it was made
    line = [*command, *flags, "-o", LIBRARY, source.name, "-lm"]
    try:
        done = subprocess.run(line, cwd=place, capture_output=True, text=True, timeout=SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NoCompilerError(f"{command[0]} did not run: {error}") from None
    if done.returncode or not (place / LIBRARY).is_file():
        raise NoCompilerError(f"{' '.join(command)} failed: {' '.join(done.stderr.split())[:300]}")


def _identity(command: tuple[str, ...]) -> str:
    path = Path(shutil.which(command[0]) or command[0]).resolve()
    status = path.stat()
    return f"{path} {status.st_size} {status.st_mtime_ns}"


@cache
def cpu() -> str:
    """What -march=native depends on: the machine, and the CPU's features where the system tells them."""
    features = ""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.split(":")[0].strip() in ("flags", "Features", "model name", "CPU part"):
                features += line
            if not line.strip():
                break
    except OSError:
        features = platform.processor()
    return f"{platform.system()} {platform.machine()} {features}"
