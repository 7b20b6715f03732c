"""The command `ident`: fit, diagnose, simulate, demo. Heavy imports wait until a command needs them.

Exit status (contract 4): 0 done, 1 a fit failed with a reason, 2 wrong usage or input, 130 stopped by Ctrl-C.
Every error is one sentence on stderr.
"""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

app = typer.Typer(
    name="ident",
    help="Identify a robot's dynamics from recordings, and find what the model lacks.",
    epilog="First steps: [bold]ident demo[/bold] shows the whole loop on built-in data in a minute.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

STOPPED = 130
MODELS = {
    "A": "motor torque",
    "B": "joint torque sensor",
    "C": "both",
    "D": "their difference: the drive chain",
}


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"dynident {version('dynident')}")
        raise typer.Exit()


def _robot_names(incomplete: str) -> list[str]:
    from importlib.resources import files

    names = (path.name.removesuffix(".yaml") for path in files("modelgen").joinpath("robots").iterdir())
    return sorted(name for name in names if name.startswith(incomplete))


def _effect_names(incomplete: str) -> list[str]:
    from modelgen.effects import catalogue

    return sorted(name for name in catalogue() if name.startswith(incomplete))


def _model_names(incomplete: str) -> list[tuple[str, str]]:
    return [(name, text) for name, text in MODELS.items() if name.startswith(incomplete.upper())]


Study = Annotated[
    Path,
    typer.Argument(
        metavar="STUDY", help="Study file (YAML): which robot, model and recordings.", show_default=False
    ),
]
Output = Annotated[
    Path,
    typer.Option(
        "-o", "--output", help="Folder for the results; made if it is not there.", show_default=False
    ),
]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="Say each step and its time on stderr.")]


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and leave.")
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
        typer.Option(
            "--models", help="Fit several models and compare them, for example A,B,C,D.", show_default=False
        ),
    ] = None,
    verbose: Verbose = False,
) -> None:
    """Identify the base parameters: fit.json, tables, plots and report.html.

    The study says which robot, which model (A motor torque, B joint torque sensor, C both, D their
    difference) and which recordings are fitted (identify), decide what is kept (validate) or are only
    reported (test).
    """
    from ident.command_line import commands

    commands.fit(study, output, tuple(models.split(",")) if models else (), verbose)


@app.command(epilog="Example: [bold]ident diagnose study.yaml -o out[/bold]   then open out/report.html")
def diagnose(study: Study, output: Output, verbose: Verbose = False) -> None:
    """Fit, find structure in the residual, trace it to effects the model lacks, add them, fit again.

    Writes diagnosis.json, plots, report.html and, in model/, C and parameters of the extended model. An
    effect is kept only if it lowers the error on recordings, or blocks of recordings, that it was not fitted
    on; what no known effect explains is reported as unexplained.
    """
    from ident.command_line import commands

    commands.diagnose(study, output, verbose)


@app.command(
    epilog="Example: [bold]ident simulate kuka_lwr4p --effect stribeck_friction:4 -o twin[/bold]\n\n"
    "Then: [bold]ident diagnose twin/study.yaml -o out[/bold]"
)
def simulate(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT",
            help="Built-in name or robot file (YAML).",
            autocompletion=_robot_names,
            show_default=False,
        ),
    ],
    output: Output,
    model: Annotated[
        str,
        typer.Option(
            "--model", help="Model of the study that is written: A, B, C or D.", autocompletion=_model_names
        ),
    ] = "A",
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            help="NAME:JOINT[:param=value,...], may be repeated; the study does not declare it.",
            autocompletion=_effect_names,
            show_default=False,
        ),
    ] = None,
    payload: Annotated[
        float | None,
        typer.Option("--payload", help="Mass in kg carried in a further run.", show_default=False),
    ] = None,
    parameters: Annotated[
        Path | None,
        typer.Option("--parameters", help="YAML of true parameters, as Iam1: 3.19.", show_default=False),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="The same seed gives the same files, bit for bit.")] = 0,
    verbose: Verbose = False,
) -> None:
    """Simulate a digital twin: recordings and a study, with effects that the study does not declare."""
    from ident.command_line import commands

    commands.simulate(robot, output, model, tuple(effect or ()), payload, seed, parameters, verbose)


@app.command(
    epilog="Example: [bold]ident demo[/bold]   or, into a folder of your own, [bold]ident demo -o look[/bold]"
)
def demo(
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for recordings, results and report.")
    ] = Path("out-demo"),
    verbose: Verbose = False,
) -> None:
    """Show the main job on built-in data: a robot hides an effect, the loop finds it."""
    from ident.command_line import commands

    commands.demo(output, verbose)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit status."""
    sys.exit(run(arguments))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status instead of leaving."""
    try:
        status = app(args=arguments, prog_name="ident", standalone_mode=False) or 0
        return _stopped() if status == STOPPED else status  # typer turns Ctrl-C into this status itself
    except (KeyboardInterrupt, typer.Abort):
        return _stopped()
    except typer.Exit as leave:
        return leave.exit_code
    except BrokenPipeError:
        sys.stdout = None  # whoever read our output has left, as `head` does
        return 0
    except Exception as error:
        status, text = exit_status(error), sentence(error)
        return _say(f"ident: {text}", status) if text else status


BASE_ERRORS = (
    ("modelgen.errors", "ModelgenError"),
    ("generated.errors", "GeneratedError"),
    ("ident.errors", "IdentError"),
)


def exit_status(error: Exception) -> int:
    """1 for a fit that failed with a reason, 2 for wrong usage or input; all else is our mistake: raised.

    A module that was never imported cannot have raised, so none is imported here.
    """
    from ident.errors import FitFailedError

    if isinstance(error, FitFailedError):
        return 1
    ours = tuple(getattr(sys.modules[module], name) for module, name in BASE_ERRORS if module in sys.modules)
    if isinstance(error, ours) or hasattr(error, "format_message"):  # the latter is wrong usage
        return 2
    raise error


def sentence(error: Any) -> str:
    """What went wrong in one line; for wrong usage with the help that shows the right one."""
    if hasattr(error, "format_message"):
        if not error.format_message():
            return ""  # the help was shown instead
        context = getattr(error, "ctx", None)
        command = context.command_path if context is not None else "ident"
        return f"{error.format_message().rstrip('.')}; see {command} --help"
    return " ".join(str(error).split())


def _stopped() -> int:
    return _say("ident: stopped; nothing was written", STOPPED)


def _say(text: str, status: int) -> int:
    print(text, file=sys.stderr)
    return status


if __name__ == "__main__":
    main()
