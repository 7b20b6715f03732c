"""The app `ident`, and the arguments that its commands share.

Each command is one function in a file of this folder: what it takes, with help and an example, and what it
does, a thin shell over the door. Heavy imports wait inside until it runs.
"""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from modelgen.command_line import folder, robot_names, show_version

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
EffectsFolder = Annotated[
    Path | None, option("--effects-folder", help="Folder of your own effects, one file each.")
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
