"""`ident fleet`: the table, the page, and on the terminal what changed."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from ident.command_line.app import Output, Overwrite, Verbose, app, argument, option
from ident.command_line.terminal import print_table, progress_bar
from modelgen.command_line import robot_names


@app.command(
    epilog="Example: [bold]ident fleet 'logs/{robot}/{day}.parquet' --robot kuka_lwr4p -o night[/bold]\n\n"
    "Needs the extra [bold]fleet[/bold]: pip install 'dynident\\[fleet]'"
)
def fleet(
    source: Annotated[
        str,
        argument(
            metavar="PATTERN|TABLE",
            help="Recordings, {robot} and {day} in their path (also s3://, gs://); a CSV: file, robot, day.",
        ),
    ],
    robot: Annotated[
        str,
        option(
            "--robot", help="Built-in name, robot file or URDF of all of them.", autocompletion=robot_names
        ),
    ],
    output: Output,
    study: Annotated[
        Path | None, option("--study", help="Study whose other keys hold for every recording.")
    ] = None,
    scheduler: Annotated[
        str | None,
        option(
            "--scheduler",
            metavar="ADDRESS|local",
            help="Dask scheduler, or local for workers on this machine; this process by default.",
        ),
    ] = None,
    diagnose: Annotated[
        bool, typer.Option(help="Diagnose the last recording of each robot that changed.")
    ] = True,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Many robots, many days: one table, and what changed in which joint.

    Every recording is summarised once; a run that was stopped, or is repeated with more recordings, goes on
    where it was. Writes fleet.parquet (one row a robot and 15 min), report.html and summaries/.
    """
    try:
        import fsspec  # noqa: F401
    except ImportError:
        from ident.errors import IdentError

        raise IdentError("ident fleet needs the extra fleet; pip install 'dynident[fleet]'") from None
    from ident.fleet.fleet import jobs_of, run_fleet, study_keys
    from ident.output import staged

    keys = study_keys(robot, study)
    inputs = [study] if study else []
    jobs = jobs_of(source, keys)  # a wrong address leaves no folder
    with staged(output, "ident fleet", overwrite=overwrite, inputs=inputs, complete=False) as stage:
        (stage / "fleet.txt").write_text(f"{source}\n{robot}\n", encoding="utf-8")
    with progress_bar(verbose) as progress:
        done = run_fleet(jobs, keys, output, scheduler, diagnose, progress)
        from ident.fleet.page import page
        from ident.fleet.trends import WATCH
        from ident.report.render import write

        with staged(output, "ident fleet", overwrite=overwrite, inputs=inputs, complete=False) as stage:
            (stage / "fleet.parquet").write_bytes(done.table)
            write(page(done), stage / "report.html")
    for job in done.jobs:
        if job in done.reasons:
            print(f"warning: {job.robot}, {job.day}: {done.reasons[job]}", file=sys.stderr)
    changes = done.trends.changes if done.trends else ()
    rows = [(c.robot, c.joint, c.level, f"{c.percent:+.0f}", c.since, c.day) for c in changes]
    header = ("robot", "joint", "level", "friction %", "since", "seen on")
    if rows:
        print_table("what changed", header, rows)
    used, robots = len(done.summaries), len(done.robots)
    print(
        f"{used} of {len(done.jobs)} recordings of {robots} robots; {WATCH:g} watch a robot-year is chance\n"
        f"wrote {output / 'fleet.parquet'} and {output / 'report.html'}"
    )
