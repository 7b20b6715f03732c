"""`ident inspect`: tables on the terminal, a first study and a page beside it."""

import sys
from pathlib import Path
from typing import Annotated

from ident.command_line.app import Exact, Overwrite, Verbose, app, argument, option
from ident.command_line.terminal import print_table, progress_bar
from modelgen.command_line import folder, robot_names


@app.command(
    epilog="Example: [bold]ident inspect monday.mcap --robot arm.urdf -o study.yaml[/bold]\n\n"
    "What a JointState's effort is, by driver: Universal Robots motor_current; Franka, KUKA LBR, Kinova Gen3 "
    "joint_torque; simulators motor_torque. The study says it (effort:), nothing guesses it."
)
def inspect(
    recordings: Annotated[
        list[Path],
        argument(
            metavar="RECORDING...",
            help="Parquet, CSV, NPZ, MAT, HDF5, ROS bags (file or folder) of one robot.",
        ),
    ],
    robot: Annotated[
        str | None, option("--robot", help="Built-in name, robot file or URDF.", autocompletion=robot_names)
    ] = None,
    output: Annotated[
        Path | None,
        option(
            "-o",
            "--output",
            parser=folder,
            metavar="FILE",
            help="First study (YAML), and a page (HTML) beside it.",
        ),
    ] = None,
    topic: Annotated[
        str | None, option("--topic", help="Topic to read of bags with several joint states.")
    ] = None,
    exact: Exact = False,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Look into logs before anything is fitted: signals, clock, what is wrong, what the motion shows.

    Writes a first study in which what could not be known is marked FILL IN; ident fit waits until it is.
    """
    from ident.inspection import page as shown
    from ident.inspection.inspection import inspect_recordings
    from ident.output import OutputError, beside, write_file
    from ident.report.joints import named
    from ident.report.render import render

    page = beside(output, ".html") if output is not None else None
    for target in (output, page):
        if target is not None and target.exists() and not overwrite:
            raise OutputError(f"{target} is there already; name another file, or give --overwrite")
        if target is not None and any(target.resolve() == path.resolve() for path in recordings):
            raise OutputError(f"{target} is an input of this command; name another file with -o")
    folder = output.parent if output is not None else Path()
    with progress_bar(verbose) as progress:
        inspection = inspect_recordings(recordings, robot, folder, progress, topic, exact)
    for note in inspection.robot_notes:
        print(f"note: {note}", file=sys.stderr)
    for text, _ in shown.remarks(inspection):
        print(text, file=sys.stderr)
    study = inspection.study
    if found := shown.remarks(inspection):
        study += "# What was found in the recordings:\n" + "".join(f"#   {text}\n" for text, _ in found)
    header, rows = shown.log_rows(inspection)
    print_table("recordings", header, rows)
    for log in inspection.logs:
        header, rows = shown.column_rows(log)
        print_table(log.label, header, rows)
    if inspection.excitation is not None:
        print(named(inspection.excitation.sentence, inspection.joints))
        header, weakest = shown.excitation_rows(inspection)
        said = [tuple(named(cell, inspection.joints) for cell in row) for row in weakest]
        print_table("parameters shown least", header, said)
    if output is None or page is None:
        print(study)
        return
    write_file(output, study, overwrite=overwrite)
    write_file(page, render(shown.page(inspection, output.name)), overwrite=overwrite)
    print(f"wrote {output} and {page}")
    print(shown.next_step(inspection, str(output)))
