"""`ident excite`: design or evaluate a motion, write it, say what it is expected to show."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ident.command_line.terminal import print_table, progress_bar
from ident.output import staged

SHOWN = 8  # parameters in the table
RATES = (10.0, 10000.0)  # Hz of the files


def excite(
    robot: str, output: Path, overwrite: bool, verbose: bool, rate: float, start: str | None, **options: Any
) -> None:
    """Check, design under Ctrl-C, write, print."""
    from ident.excitation import experiment, writing
    from ident.excitation.limits import ExcitationError

    if not RATES[0] <= rate <= RATES[1]:
        raise ExcitationError(f"--rate {rate:g}: choose {RATES[0]:g} to {RATES[1]:g} Hz.")
    request = experiment.Request(robot, start=_numbers(start), **options)
    experiment.check(request)
    inputs = [Path(robot), *filter(None, (request.parameters, request.diagnosis, request.evaluate))]
    staging = staged(output, "ident excite", overwrite=overwrite, inputs=inputs)
    with staging as stage, stopping() as stopped:
        with progress_bar(verbose) as progress:
            done = experiment.excite(request, progress, stopped)
        missing = writing.write_experiment(done, stage, rate)
    for remark in (*done.remarks, *missing):
        print(f"note: {remark}", file=sys.stderr)
    header, rows = writing.parameter_rows(done)
    told = [row for row in rows if row[3]] or rows
    worst = sorted(told, key=lambda row: -float(row[3] or row[2]))[:SHOWN]
    print_table("expected to be known least", header, worst, numbers=(1, 2, 3))
    for sentence in writing.sentences(done):
        print(sentence)
    print(f"wrote {output / 'report.html'}")


def _numbers(start: str | None) -> tuple[float, ...] | None:
    from ident.excitation.limits import ExcitationError

    if start is None:
        return None
    try:
        return tuple(float(value) for value in start.split(","))
    except ValueError:
        raise ExcitationError(f"--start {start}: give one number a joint, as 0,-1.5,1.5,0,0,0.") from None


@contextlib.contextmanager
def stopping() -> Iterator[Callable[[], bool]]:
    """Ctrl-C asks the search to end with the best so far, and says so; a second one ends the program."""
    asked: list[int] = []
    before = signal.getsignal(signal.SIGINT)

    def ask(number: int, frame: Any) -> None:
        asked.append(number)
        os.write(2, b"\nstopping with the best so far; once more ends at once\n")
        signal.signal(signal.SIGINT, before)

    try:
        signal.signal(signal.SIGINT, ask)
    except ValueError:  # not the main thread
        yield lambda: False
        return
    try:
        yield lambda: bool(asked)
    finally:
        signal.signal(signal.SIGINT, before)
