"""What `regenerate-model` takes: derive, regroup, emit C, compile. Heavy imports wait until they are needed.

Exit status: 0 done, 1 what is committed is stale (--check), 2 wrong usage or input. Errors are one sentence.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from modelgen.command_line import MODELS, folder, model_names, robot_names, show_version

app = typer.Typer(
    name="regenerate-model",
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

DIFF_LINES = 60  # of a stale file, unless -v


@app.command(
    epilog="For example: [bold]regenerate-model kuka_lwr4p --rules-only --model A[/bold], or "
    "[bold]regenerate-model arm.urdf -o generated-arm[/bold]."
)
def regenerate_model(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT",
            help="Built-in name, robot file (YAML) or URDF.",
            autocompletion=robot_names,
            show_default=False,
        ),
    ] = "",
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            "-m",
            help="A, B, C or D; may be repeated. All four by default.",
            autocompletion=model_names,
            show_default=False,
        ),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            help="NAME:JOINT, a column to add; may be repeated. Behind it: :source_joint=K, :side=link.",
            show_default=False,
        ),
    ] = None,
    effects_folder: Annotated[
        Path | None,
        typer.Option(
            "--effects-folder", help="Folder of your own effects, one file each.", show_default=False
        ),
    ] = None,
    list_effects: Annotated[
        bool, typer.Option("--list-effects", help="List the effects: term, parameters, units, source; leave.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            parser=folder,
            metavar="FOLDER",
            help="Folder for the files. By default the package's own for kuka_lwr4p, else ./generated-ROBOT.",
            show_default=False,
        ),
    ] = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="A URDF's angles and lengths as they are written.")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace files that were changed or are not ours.")
    ] = False,
    check: Annotated[
        bool,
        typer.Option("--check", help="Write nothing; show a diff and exit with 1 if the files are stale."),
    ] = False,
    rules_only: Annotated[bool, typer.Option("--rules-only", help="Print the rules; emit no C.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON list, one object per model.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print the rules as Markdown.")] = False,
    latex: Annotated[bool, typer.Option("--latex", help="Print the rules as LaTeX.")] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Tell each step and its time.")] = False,
    version: Annotated[
        bool,
        typer.Option("--version", callback=show_version, is_eager=True, help="Show the version and leave."),
    ] = False,
) -> None:
    """Derive a robot's base parameters, regressor and torque from its table or URDF, and write C for them.

    Counts and printed rules include the payload that the robot file declares. Beside the C of a model stand
    its header and its description (JSON); models with the payload are files of their own (A_L.c).
    """
    from modelgen.errors import ModelgenError

    if effects_folder is not None:
        from modelgen.effects import register_folder

        register_folder(effects_folder)
    if list_effects:
        _list_effects(as_json)
        raise typer.Exit(0)
    if not robot:
        raise ModelgenError("Missing argument 'ROBOT': give a built-in name, a robot file or a URDF")
    if as_json + markdown + latex > 1:
        raise ModelgenError("--json, --markdown and --latex exclude each other; choose one")
    if rules_only and (check or output):
        raise ModelgenError("--rules-only writes no files; leave out --check and -o")
    names = tuple(dict.fromkeys(name.upper() for name in model or MODELS))
    for name in names:
        if name not in MODELS:
            raise ModelgenError(f"there is no model {name!r}; choose A, B, C or D")

    from modelgen.emit import regenerate
    from modelgen.terminal import progress

    with progress(verbose) as tell:
        plan = regenerate.plan(robot, names, tuple(effect or ()), bool(model), tell, exact)
        for remark in plan.robot.remarks:
            print(f"regenerate-model: note: {remark}", file=sys.stderr)
        status = 0
        if not rules_only:
            target = output or regenerate.default_folder(plan, robot)
            files = regenerate.files(plan, tell)
            if check:
                limit = None if verbose else DIFF_LINES
                diff = regenerate.difference(files, target, limit, complete=not (model or effect))
                status = 1 if diff else 0
            else:
                regenerate.write(files, target, overwrite)
                problem = regenerate.compile_all(files, tell)
    if check:
        print(diff, end="", file=sys.stderr if as_json else sys.stdout)
        if diff:
            print(f"{target} is stale: run regenerate-model and read the diff", file=sys.stderr)
    if as_json:
        import json

        print(json.dumps(regenerate.as_json(plan), indent=1))
    elif markdown or latex or rules_only:
        print(regenerate.as_text(plan, "markdown" if markdown else "latex" if latex else "plain"), end="")
    elif not check:
        print(f"{len(files)} files in {target}: {', '.join(sorted(files))}")
        if problem:
            print(f"not compiled: {problem}", file=sys.stderr)
    raise typer.Exit(status)


def _list_effects(as_json: bool) -> None:
    import json

    from modelgen.effects import listing

    print(json.dumps(listing.as_json(), indent=1) if as_json else listing.as_text())
