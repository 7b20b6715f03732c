"""The main job on built-in data: a simulated robot hides an effect, and the loop has to find it.

Nothing of what is hidden reaches the study; the truth is written beside it and shown at the end.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from ident.command_line.app import Overwrite, Verbose, app
from ident.command_line.terminal import progress_bar
from modelgen.command_line import folder

OPENING = (
    "A simulated Kuka LWR4+ records four runs of positions and motor torques. One of its joints has a "
    "friction that the model does not know. The loop identifies the arm, looks at what is left of the "
    "torque, and has to say what is missing, and where."
)


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
    from ident.command_line.fitting import diagnose
    from ident.output import staged
    from ident.twin import PlannedRun, simulate, write_simulation

    runs = (
        PlannedRun("points", "identify", 45.0, 22),
        PlannedRun("waves", "identify", 40.0),
        PlannedRun("other_waves", "validate", 30.0),
        PlannedRun("more_waves", "test", 40.0),
    )
    print(f"{OPENING}\n")
    staging = staged(output, "ident demo", overwrite=overwrite)
    with staging as stage, progress_bar(verbose) as progress:
        made = simulate("kuka_lwr4p", "A", ("stribeck_friction:4",), seed=4, runs=runs, progress=progress)
        write_simulation(made, stage)
    diagnose(output / "study.yaml", output / "results", None, overwrite, verbose)
    print(f"What was hidden: {answer(made.truth)}.")


def answer(truth: Mapping[str, Any]) -> str:
    """The hidden truth in words."""
    hidden = truth["effects"][0]
    values = ", ".join(f"{name} = {value:g}" for name, value in hidden["parameters"].items())
    joints = ", ".join(str(joint) for joint in hidden["joints"])
    return f"{hidden['effect'].replace('_', ' ')} on joint {joints}, {values}"
