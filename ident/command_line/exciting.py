"""`ident excite`: design or evaluate a motion, write it, say what it is expected to show."""

import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from ident.command_line.app import EffectsFolder, Exact, Output, Overwrite, Robot, Verbose, app, option
from ident.command_line.terminal import print_table, progress_bar
from modelgen.command_line import model_names

SHOWN = 8  # parameters in the table
RATES = (10.0, 10000.0)  # Hz of the files


@app.command(
    epilog="Example: [bold]ident excite ur10e -o motion[/bold]   then look at motion/motion.html\n\n"
    "Two suspects: [bold]ident excite ur10e --separate stribeck_friction:2,hysteresis:2 -o motion[/bold]"
)
def excite(
    robot: Robot,
    output: Output,
    model: Annotated[
        str, typer.Option("--model", help="Torques that are recorded.", autocompletion=model_names)
    ] = "A",
    duration: Annotated[float, typer.Option("--duration", help="Seconds.")] = 10.0,
    criterion: Annotated[
        str,
        typer.Option(
            "--criterion",
            help="balanced, d (information), condition, worst (relative deviation), bodies (condition of the "
            "bodies' columns alone).",
        ),
    ] = "balanced",
    motion: Annotated[str, typer.Option("--motion", help="fourier or point_to_point.")] = "fourier",
    limit: Annotated[
        list[str] | None,
        option(
            "--limit",
            help="q, dq, ddq, jerk, tau: KEY[:JOINT]=VALUE, as dq:2=1.5 or q=-1..1; may be repeated.",
        ),
    ] = None,
    start: Annotated[
        str | None, option("--start", help="Where it starts and ends, as 0,-1.5,1.5,0,0,0.")
    ] = None,
    keep_out: Annotated[
        list[str] | None,
        option(
            "--keep-out",
            help="A box that points stay out of, as table=-1..1,-1..1,-1..0 [m]; or a YAML file.",
        ),
    ] = None,
    point: Annotated[
        list[str] | None,
        option("--point", help="A point of a link, as tool=7:0,0,0.12 [m]; else the last one's origin."),
    ] = None,
    self_collision: Annotated[
        bool, typer.Option("--self-collision", help="A URDF's shapes never touch (extra: collision).")
    ] = False,
    separate: Annotated[
        str | None, option("--separate", help="NAME:JOINT,NAME:JOINT,...: tell these effects apart.")
    ] = None,
    from_: Annotated[
        Path | None, option("--from", help="Folder of ident diagnose: its suspects, its noise.")
    ] = None,
    evaluate: Annotated[
        Path | None, option("--evaluate", help="Say what this recording shows instead.")
    ] = None,
    parameters: Annotated[
        Path | None, option("--parameters", help="The robot's parameters: YAML, or a fit.json.")
    ] = None,
    effects_folder: EffectsFolder = None,
    noise: Annotated[float, typer.Option("--noise", help="Percent of the torques' rms.")] = 1.0,
    rate: Annotated[float, typer.Option("--rate", help="Samples a second of the files.")] = 1000.0,
    starts: Annotated[int, typer.Option("--starts", help="Motions to begin the search from.")] = 2,
    seed: Annotated[int, typer.Option("--seed", help="Other seeds, other motions.")] = 0,
    exact: Exact = False,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Design a motion that shows every parameter, or one that tells two suspects apart, under limits.

    Writes the motion (Parquet, CSV, ROS 2, URScript, a moving stick figure), the deviation that every
    parameter is expected to have, the smallest effects that would be seen, and a study for the recording
    that comes back. Ctrl-C gives the best so far. Obstacles are the boxes you name: look before it runs.
    """
    from ident.excitation import experiment, writing
    from ident.excitation.limits import ExcitationError
    from ident.output import staged

    if not RATES[0] <= rate <= RATES[1]:
        raise ExcitationError(f"--rate {rate:g}: choose {RATES[0]:g} to {RATES[1]:g} Hz.")
    request = experiment.Request(
        robot,
        model=model,
        duration=duration,
        criterion=criterion,
        kind=motion,
        limits=tuple(limit or ()),
        start=_numbers(start),
        keep_out=tuple(keep_out or ()),
        points=tuple(point or ()),
        self_collision=self_collision,
        separate=separate,
        diagnosis=from_,
        evaluate=evaluate,
        parameters=parameters,
        effects_folder=effects_folder,
        noise=noise,
        starts=starts,
        seed=seed,
        exact=exact,
    )
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
    print_table("expected to be known least", header, worst)
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
