"""What `ident` takes: fit, diagnose, simulate, demo. Heavy imports wait until a command needs them."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from modelgen.command_line import effect_names, folder, model_names, robot_names, show_version

app = typer.Typer(
    name="ident",
    help="Identify a robot's dynamics from recordings, and find what the model lacks.",
    epilog="First steps: [bold]ident demo[/bold] shows the whole loop on built-in data in a minute.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

argument = partial(typer.Argument, show_default=False)
option = partial(typer.Option, show_default=False)  # without a default, or with one that its help tells
ROBOT = "Built-in name, robot file (YAML) or URDF."

Study = Annotated[
    Path, argument(metavar="STUDY", help="Study file (YAML): which robot, model and recordings.")
]
Robot = Annotated[str, argument(metavar="ROBOT", help=ROBOT, autocompletion=robot_names)]
Output = Annotated[
    Path,
    option(
        "-o",
        "--output",
        parser=folder,
        metavar="FOLDER",
        help="Folder for the results: new, empty, or written by this program before.",
    ),
]
Fit = Annotated[
    Path, argument(metavar="FIT", help="Folder that ident fit or ident diagnose wrote, or its fit.json.")
]
Exact = Annotated[bool, typer.Option("--exact", help="A URDF's angles and lengths as they are written.")]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace files that were changed, or that are not ours.")
]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="Say each step and its time on stderr.")]


@app.callback()
def _main(
    version: Annotated[
        bool,
        typer.Option("--version", callback=show_version, is_eager=True, help="Show the version and leave."),
    ] = False,
) -> None: ...


@app.command(
    epilog="Example: [bold]ident fit study.yaml -o out[/bold]   then open out/report.html\n\n"
    "The paper's Table II in one call: [bold]ident fit study.yaml --models A,B,C,D -o out[/bold]"
)
def fit(
    study: Study,
    output: Output,
    models: Annotated[
        str | None,
        option("--models", help="Fit several models and compare them, for example A,B,C,D."),
    ] = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Identify the base parameters: fit.json, tables, plots and report.html.

    The study says which robot, which model (A motor torque, B joint torque sensor, C both, D their
    difference) and which recordings are fitted (identify), decide what is kept (validate) or are only
    reported (test).
    """
    from ident.command_line import commands

    commands.fit(study, output, tuple(models.split(",")) if models else (), overwrite, verbose)


@app.command(epilog="Example: [bold]ident diagnose study.yaml -o out[/bold]   then open out/report.html")
def diagnose(
    study: Study,
    output: Output,
    memory: Annotated[
        str | None,
        option(
            "--memory",
            metavar="SIZE",
            help="Keep below this, for example 2GB; half of what is free by default.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Fit, find structure in the residual, trace it to effects the model lacks, add them, fit again.

    Writes diagnosis.json, plots, report.html and, in model/, C and parameters of the extended model. An
    effect is kept only if it lowers the error on recordings, or blocks of recordings, that it was not fitted
    on; what no known effect explains is reported as unexplained.
    """
    from ident.command_line import commands

    commands.diagnose(study, output, memory, overwrite, verbose)


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
    payload: Annotated[
        float | None,
        option("--payload", help="Mass in kg carried in a further run."),
    ] = None,
    parameters: Annotated[
        Path | None,
        option("--parameters", help="YAML of true parameters, as Iam1: 3.19."),
    ] = None,
    exact: Exact = False,
    seed: Annotated[int, typer.Option("--seed", help="The same seed gives the same files, bit for bit.")] = 0,
    duration: Annotated[
        float | None,
        option("--duration", help="Seconds of every run; 60 and 90 by default."),
    ] = None,
    rate: Annotated[
        float | None,
        option("--rate", help="Samples a second; 1000 by default."),
    ] = None,
    noise: Annotated[
        float | None,
        option("--noise", help="Noise of the torques, percent of their rms; 1 by default."),
    ] = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Simulate a digital twin: recordings and a study, with effects that the study does not declare."""
    from ident.command_line import commands

    commands.simulate(
        robot,
        output,
        overwrite,
        verbose,
        model=model,
        effects=tuple(effect or ()),
        payload=payload,
        duration=duration,
        rate_hz=rate,
        noise=noise,
        seed=seed,
        parameters=parameters,
        exact=exact,
    )


@app.command(epilog="Example: [bold]ident predict out monday.parquet -o monday[/bold]")
def predict(
    fit: Fit,
    recording: Annotated[Path, argument(metavar="RECORDING", help="A log of the same robot.")],
    output: Output,
    payload: Annotated[
        str | None,
        option("--payload", help="Label of a payload of the fit that is carried."),
    ] = None,
    episode: Annotated[
        int | None,
        option("--episode", help="Which episode of a table that has several."),
    ] = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Predict the torque of a new log: its error, and where and when it leaves the fit's own band.

    Writes predict.json, predict.csv, predict.parquet and a plot. A contact, a payload that is not declared,
    wear and a changed drive leave the band; what the fit was always wrong by does not. Of a log without
    torques the predicted torque alone is written, with its band.
    """
    from ident.command_line import kept_fits

    kept_fits.predict(fit, recording, output, payload, episode, overwrite, verbose)


@app.command(
    epilog="Example: [bold]ident export out --c controller --urdf arm_identified.urdf[/bold]\n\n"
    "URDF and MJCF need the extra [bold]export[/bold]: pip install 'dynident\\[export]'; where the extra "
    "[bold]mujoco[/bold] is installed, MuJoCo reads the MJCF before it is written"
)
def export(
    fit: Fit,
    c: Annotated[
        Path | None,
        typer.Option("--c", parser=folder, metavar="FOLDER", help="C with numbers into this folder."),
    ] = None,
    float32: Annotated[bool, typer.Option("--float32", help="C that computes in float.")] = False,
    name: Annotated[str | None, option("--name", help="Start of the C names and files.")] = None,
    urdf: Annotated[
        Path | None, typer.Option("--urdf", metavar="FILE", help="A physically consistent URDF.")
    ] = None,
    mjcf: Annotated[Path | None, typer.Option("--mjcf", metavar="FILE", help="The same for MuJoCo.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write an identified robot as C with numbers, or as a URDF or MJCF that a simulator accepts.

    C holds the fit as it is. In a URDF or MJCF every body is one that can exist: where no such robot has the
    identified parameters, the nearest one that can be is written, and what that costs is said.
    """
    from ident.command_line import kept_fits

    kept_fits.export(fit, c, float32, name, urdf, mjcf, overwrite)


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
        str | None,
        option("--robot", help="Built-in name, robot file or URDF.", autocompletion=robot_names),
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
        str | None,
        option("--topic", help="Topic to read of bags with several joint states."),
    ] = None,
    exact: Exact = False,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Look into logs before anything is fitted: signals, clock, what is wrong, what the motion shows.

    Writes a first study in which what could not be known is marked FILL IN; ident fit waits until it is.
    """
    from ident.command_line import inspecting

    inspecting.inspect(recordings, robot, output, topic, exact, overwrite, verbose)


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
        str | None,
        option("--start", help="Where it starts and ends, as 0,-1.5,1.5,0,0,0."),
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
        str | None,
        option("--separate", help="NAME:JOINT,NAME:JOINT,...: tell these effects apart."),
    ] = None,
    from_: Annotated[
        Path | None,
        option("--from", help="Folder of ident diagnose: its suspects, its noise."),
    ] = None,
    evaluate: Annotated[
        Path | None,
        option("--evaluate", help="Say what this recording shows instead."),
    ] = None,
    parameters: Annotated[
        Path | None,
        option("--parameters", help="The robot's parameters: YAML, or a fit.json."),
    ] = None,
    effects_folder: Annotated[
        Path | None,
        option("--effects-folder", help="Folder of your own effects, one file each."),
    ] = None,
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
    from ident.command_line import exciting

    exciting.excite(
        robot,
        output,
        overwrite,
        verbose,
        rate,
        start,
        model=model,
        duration=duration,
        criterion=criterion,
        kind=motion,
        limits=tuple(limit or ()),
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


@app.command(epilog="Example: [bold]ident robot arm.urdf -o arm.yaml[/bold]")
def robot(
    file: Annotated[
        str,
        typer.Argument(metavar="FILE", help="URDF, robot file or built-in name.", autocompletion=robot_names),
    ],
    output: Annotated[
        Path,
        option("-o", "--output", parser=folder, metavar="FILE", help="Robot file (YAML)."),
    ],
    exact: Exact = False,
    overwrite: Overwrite = False,
) -> None:
    """Write a URDF (or a table) as a robot file in Khalil's modified Denavit-Hartenberg convention."""
    from ident.command_line import commands

    commands.robot(file, output, exact, overwrite)


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
        Path | None,
        option("--study", help="Study whose other keys hold for every recording."),
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
    from ident.command_line import fleet as fleets

    fleets.fleet(source, robot, study, output, scheduler, diagnose, overwrite, verbose)


@app.command(
    epilog="Example: [bold]ident demo[/bold]   or, into a folder of your own, [bold]ident demo -o look[/bold]"
)
def demo(
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", parser=folder, metavar="FOLDER", help="Folder for recordings, results, report."
        ),
    ] = Path("out-demo"),
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Show the main job on built-in data: a robot hides an effect, the loop finds it."""
    from ident.command_line import commands

    commands.demo(output, overwrite, verbose)
