"""The command `regenerate-model`: derive, regroup, emit C, compile. Heavy imports wait until they are needed.

Exit status: 0 done, 1 what is committed is stale (--check), 2 wrong usage or input. Errors are one sentence.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    name="regenerate-model",
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

MODELS = {"A": "motor torque", "B": "torque sensor", "C": "both", "D": "their difference"}
STOPPED = 130
DIFF_LINES = 60  # of a stale file, unless -v


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"dynident {version('dynident')}")
        raise typer.Exit()


def _robot_names(incomplete: str) -> list[str]:
    names = (path.stem for path in Path(__file__).parent.joinpath("robots").glob("*.yaml"))
    return sorted(name for name in names if name.startswith(incomplete))


def _model_names(incomplete: str) -> list[tuple[str, str]]:
    return [(name, text) for name, text in MODELS.items() if name.startswith(incomplete.upper())]


@app.command(
    epilog="For example: [bold]regenerate-model kuka_lwr4p --rules-only --model A[/bold], or "
    "[bold]regenerate-model myrobot.yaml -o generated-myrobot[/bold]."
)
def regenerate_model(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT",
            help="Built-in name or robot file.",
            autocompletion=_robot_names,
            show_default=False,
        ),
    ],
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            "-m",
            help="A, B, C or D; may be repeated. All four by default.",
            autocompletion=_model_names,
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
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Folder for the files. By default the package's own for kuka_lwr4p, else ./generated-ROBOT.",
            show_default=False,
        ),
    ] = None,
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
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and leave.")
    ] = False,
) -> None:
    """Derive a robot's base parameters, regressor and torque from its MDH table, and write C for them.

    Counts and printed rules include the payload that the robot file declares. Beside the C of a model stand
    its header and its description (JSON); models with the payload are files of their own (A_L.c).
    """
    from modelgen.errors import ModelgenError

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
        plan = regenerate.plan(robot, names, tuple(effect or ()), bool(model), tell)
        for remark in plan.robot.remarks:
            print(f"regenerate-model: note: {remark}", file=sys.stderr)
        status = 0
        if not rules_only:
            folder = output or regenerate.default_folder(plan, robot)
            files = regenerate.files(plan, tell)
            if check:
                limit = None if verbose else DIFF_LINES
                diff = regenerate.difference(files, folder, limit, complete=not (model or effect))
                status = 1 if diff else 0
            else:
                regenerate.write(files, folder)
                problem = regenerate.compile_all(files, tell)
    if check:
        print(diff, end="", file=sys.stderr if as_json else sys.stdout)
        if diff:
            print(f"{folder} is stale: run regenerate-model and read the diff", file=sys.stderr)
    if as_json:
        import json

        print(json.dumps(regenerate.as_json(plan), indent=1))
    elif markdown or latex or rules_only:
        print(regenerate.as_text(plan, "markdown" if markdown else "latex" if latex else "plain"), end="")
    elif not check:
        print(f"{len(files)} files in {folder}: {', '.join(sorted(files))}")
        if problem:
            print(f"not compiled: {problem}", file=sys.stderr)
    raise typer.Exit(status)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit status."""
    sys.exit(run(arguments))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status. Every error becomes one sentence on stderr."""
    from modelgen.errors import ModelgenError

    try:
        status = app(args=arguments, prog_name="regenerate-model", standalone_mode=False) or 0
        return _stopped() if status == STOPPED else status  # typer turns Ctrl-C into this status itself
    except (KeyboardInterrupt, typer.Abort):
        return _stopped()
    except typer.Exit as leave:
        return leave.exit_code
    except BrokenPipeError:
        sys.stdout = None  # whoever read our output has left, as `head` does
        return 0
    except ModelgenError as error:
        return _refused(str(error))
    except OSError as error:
        return _refused(
            f"{error.filename or 'a file'}: {error.strerror}; name another file, or folder with -o"
        )
    except Exception as error:
        if not hasattr(error, "format_message"):  # wrong usage has one; anything else is our mistake
            raise
        return _refused(f"{error.format_message().rstrip('.')}; see regenerate-model --help")


def _refused(sentence: str) -> int:
    print(f"regenerate-model: {' '.join(sentence.split())}", file=sys.stderr)
    return 2


def _stopped() -> int:
    print("stopped; nothing was left half written", file=sys.stderr)
    return STOPPED
