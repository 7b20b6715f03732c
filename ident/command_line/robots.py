"""`ident simulate` and `ident robot`: a digital twin of a robot, and its table from a URDF."""

from pathlib import Path
from typing import Annotated

import typer

from ident.command_line.app import EffectsFolder, Exact, Output, Overwrite, Robot, Verbose, app, option
from ident.command_line.terminal import print_table, progress_bar, say_notes
from modelgen.command_line import effect_names, folder, model_names, robot_names


@app.command(
    epilog="Example: [bold]ident simulate kuka_lwr4p --effect stribeck_friction:4 -o twin[/bold]\n\n"
    "Then: [bold]ident diagnose twin/study.yaml -o out[/bold]"
)
def simulate(
    robot: Robot,
    output: Output,
    model: Annotated[
        str,
        typer.Option(
            "--model", help="Model of the study that is written: A, B, C or D.", autocompletion=model_names
        ),
    ] = "A",
    effect: Annotated[
        list[str] | None,
        option(
            "--effect",
            help="NAME:JOINT[:param=value,...], may be repeated; the study does not declare it.",
            autocompletion=effect_names,
        ),
    ] = None,
    effects_folder: EffectsFolder = None,
    payload: Annotated[float | None, option("--payload", help="Mass in kg carried in a further run.")] = None,
    parameters: Annotated[
        Path | None, option("--parameters", help="YAML of true parameters, as Iam1: 3.19.")
    ] = None,
    exact: Exact = False,
    seed: Annotated[int, typer.Option("--seed", help="The same seed gives the same files, bit for bit.")] = 0,
    duration: Annotated[
        float | None, option("--duration", help="Seconds of every run; 60 and 90 by default.")
    ] = None,
    rate: Annotated[float | None, option("--rate", help="Samples a second; 1000 by default.")] = None,
    noise: Annotated[
        float | None, option("--noise", help="Noise of the torques, percent of their rms; 1 by default.")
    ] = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Simulate a digital twin: recordings and a study, with effects that the study does not declare."""
    from ident.command_line.light import ident
    from ident.output import staged

    if effects_folder is not None:
        from modelgen.effects import register_folder

        register_folder(effects_folder)
    inputs = [Path(robot), *([parameters] if parameters else [])]
    staging = staged(output, "ident simulate", overwrite=overwrite, inputs=inputs)
    with staging as stage, progress_bar(verbose) as progress:
        made = ident.simulate(
            robot,
            model,
            tuple(effect or ()),
            payload=payload,
            duration=duration,
            rate_hz=rate,
            noise=noise,
            seed=seed,
            parameters=parameters,
            exact=exact,
            progress=progress,
        )
        made.save(stage)
    header, rows = made.table()
    rows = [(f"{row[0]}.parquet", *row[1:]) for row in rows]
    say_notes(made.result.robot.remarks)
    print_table(made.result.robot.name, header, rows)
    print(f"wrote {output / 'study.yaml'}; next: ident diagnose {output / 'study.yaml'} -o RESULTS")


@app.command(epilog="Example: [bold]ident robot arm.urdf -o arm.yaml[/bold]")
def robot(
    file: Annotated[
        str,
        typer.Argument(metavar="FILE", help="URDF, robot file or built-in name.", autocompletion=robot_names),
    ],
    output: Annotated[
        Path, option("-o", "--output", parser=folder, metavar="FILE", help="Robot file (YAML).")
    ],
    exact: Exact = False,
    overwrite: Overwrite = False,
) -> None:
    """Write a URDF (or a table) as a robot file in Khalil's modified Denavit-Hartenberg convention."""
    from ident.output import OutputError, write_file
    from modelgen.geometry.robot_text import robot_text

    if output.exists() and Path(file).exists() and output.samefile(file):
        raise OutputError(f"{output} is the input of this command; name another file with -o")
    text, remarks = robot_text(file, exact)
    write_file(output, text, overwrite=overwrite)
    say_notes(remarks)
    print(f"wrote {output}; next: regenerate-model {output} --rules-only")
