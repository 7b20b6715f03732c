"""`ident predict` and `ident export`: what is done with a fit's folder."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ident.command_line.app import Fit, Output, Overwrite, Verbose, app, argument, option
from ident.command_line.terminal import print_table, progress_bar
from modelgen.command_line import folder


@app.command(epilog="Example: [bold]ident predict out monday.parquet -o monday[/bold]")
def predict(
    fit: Fit,
    recording: Annotated[Path, argument(metavar="RECORDING", help="A log of the same robot.")],
    output: Output,
    payload: Annotated[
        str | None, option("--payload", help="Label of a payload of the fit that is carried.")
    ] = None,
    episode: Annotated[
        int | None, option("--episode", help="Which episode of a table that has several.")
    ] = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Predict the torque of a new log: its error, and where and when it leaves the fit's own band.

    Writes predict.json, predict.csv, predict.parquet and a plot. A contact, a payload that is not declared,
    wear and a changed drive leave the band; what the fit was always wrong by does not. Of a log without
    torques the predicted torque alone is written, with its band.
    """
    from ident.export.saved import load_fit
    from ident.output import staged
    from ident.report.joints import named, names_of, with_names

    saved = load_fit(fit)
    from ident.prediction.files import channel_table, excursion_table, write_prediction
    from ident.prediction.prediction import predict as predicted
    from ident.report.files import write_csv, write_document

    staging = staged(output, "ident predict", overwrite=overwrite, inputs=[fit, recording])
    with staging as stage, progress_bar(verbose) as progress:
        found = predicted(saved, recording, payload, progress, episode)
        progress("writing torques and plot")
        document = write_prediction(found, stage)
        write_document(stage / "predict.json", document)
        write_csv(stage / "predict.csv", channel_table(document))
    names = names_of(document)
    header, rows = with_names(*channel_table(document), names)
    print_table(f"prediction of {found.stream.label}", header, rows)
    if document["excursions"]:
        header, rows = excursion_table(document)
        print_table("leaves the fit's band", *with_names(header, rows, names))
        print(
            "The log leaves what this fit was ever wrong by; a contact, a payload that is not declared, "
            "wear and a changed drive do so."
        )
    elif found.compared:
        print("Nothing leaves the fit's band.")
    else:
        print("The log holds no torques: what is written is the predicted torque and its band.")
    for warning in document["warnings"]:
        print(f"warning: {named(warning, names)}", file=sys.stderr)
    print(f"wrote {output / 'predict.json'}")


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
    from ident.export.combination import ExportError
    from ident.export.saved import load_fit
    from ident.output import staged

    if not (c or urdf or mjcf):
        raise ExportError("nothing to write; name what you want: --c FOLDER, --urdf FILE or --mjcf FILE")
    saved = load_fit(fit)
    robot = saved.load_robot()
    if c:
        from ident.export.c_source import c_code

        code = c_code(saved, robot, name, float32)
        with staged(c, "ident export", overwrite=overwrite, inputs=[fit], complete=False) as stage:
            (stage / f"{code.name}.h").write_text(code.header, encoding="utf-8")
            (stage / f"{code.name}.c").write_text(code.source, encoding="utf-8")
        for label, reason in code.left_out.items():
            print(f"warning: {label} is in the fit and not in the C: {reason}", file=sys.stderr)
        print(f"wrote {c / f'{code.name}.h'} and {code.name}.c; link with -lm")
    if urdf or mjcf:
        _bodies(saved, robot, urdf, mjcf, overwrite)


def _bodies(saved: Any, robot: Any, urdf: Path | None, mjcf: Path | None, overwrite: bool) -> None:
    from ident.export.carried import cost_table, delays, left_out, left_out_table
    from ident.export.consistent import consistent, parameter_table
    from ident.export.mjcf import is_checked, write_mjcf
    from ident.export.urdf import write_urdf
    from ident.export.urdf_template import fill_urdf
    from ident.output import beside, write_file
    from ident.report.joints import joints_of_robot, named, names_in, with_names

    found = consistent(saved, robot)
    for path, form in ((urdf, "urdf"), (mjcf, "mjcf")):
        if path is None:
            continue
        lost = left_out(saved, found, form)
        said, own = note(saved, found, lost), Path(saved.robot)
        if form == "mjcf":
            text = write_mjcf(robot, found, said, delays(saved))
        elif own.suffix == ".urdf":
            text = fill_urdf(own.read_bytes(), own.name, found, said, saved.study.exact)
        else:
            text = write_urdf(robot, found, said)
        write_file(path, text, overwrite=overwrite)
        for joint, delay in delays(saved).items() if form == "mjcf" else ():
            when, what = ("before", "motor acts") if delay < 0 else ("after", "torque sensor answers")
            late = f"the torque of {robot.joint_names[joint]} was recorded {1e3 * abs(delay):.3g} ms {when}"
            print(f"note: {late} the position: its {what} that much later in {path}")
        if form == "urdf" and own.suffix == ".urdf" and (gravity := saved.study.gravity) is not None:
            print(
                f"note: {path} holds no gravity; set {list(gravity)} m/s^2 in its root link where it is used"
            )
        if form == "mjcf" and not is_checked():
            print(f"note: {path} was not read by MuJoCo; pip install 'dynident[mujoco]' has it checked")
        if lost:
            header, rows = left_out_table(lost)
            print_table(f"what {path.name} cannot hold", header, rows)
        print(f"wrote {path}")
    header, rows = cost_table(saved, found)
    names = names_in(joints_of_robot(robot))
    print_table("error in percent", *with_names(header, rows, names))
    header, rows = parameter_table(found)
    values = beside((urdf or mjcf), ".csv")  # type: ignore[arg-type]
    write_file(values, "\n".join(",".join(row) for row in (header, *rows)) + "\n", overwrite=overwrite)
    measured = sum(row[-1] == "measured" for row in rows)
    print(f"wrote {values}: {measured} parameters measured, {len(rows) - measured} from the prior")
    print(found.sentence())
    for finding in found.findings:
        print(f"warning: {named(finding, names)}", file=sys.stderr)


def note(saved: Any, found: Any, lost: Any) -> str:
    """The comment at the head of a written robot."""
    missing = ", ".join(f"{item.term} ({item.rms:.2g} N m rms)" for item in lost)
    return (
        f"{saved.columns.model.robot_name}, identified, model {saved.study.model}. Written by ident export. "
        f"{found.sentence()}" + (f" Not in this file: {missing}." if missing else "")
    )
