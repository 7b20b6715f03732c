"""What `ident predict` and `ident export` do with a fit's folder: read, call, write, say what came out."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from ident.command_line.terminal import print_table, progress_bar
from ident.output import beside, staged, write_file
from ident.report.joints import joints_of_robot, named, names_in, names_of, with_names


def predict(
    fit: Path,
    recording: Path,
    output: Path,
    payload: str | None,
    episode: int | None,
    overwrite: bool,
    verbose: bool,
) -> None:
    """`ident predict`: torque on a new log, its error, and where the log leaves the fit's band."""
    from ident.export.saved import load_fit

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
    print_table(f"prediction of {found.stream.label}", header, rows, numbers=range(1, len(header)))
    if document["excursions"]:
        header, rows = excursion_table(document)
        words = len(header) - 1  # how long it lasts, and the joint
        print_table("leaves the fit's band", *with_names(header, rows, names), numbers=range(1, words))
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


def export(
    fit: Path,
    c: Path | None,
    float32: bool,
    name: str | None,
    urdf: Path | None,
    mjcf: Path | None,
    overwrite: bool,
) -> None:
    """`ident export`: C with numbers, and physically consistent URDF and MJCF files."""
    from ident.export.combination import ExportError
    from ident.export.saved import load_fit

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
            print_table(f"what {path.name} cannot hold", header, rows, numbers=range(2, len(header)))
        print(f"wrote {path}")
    header, rows = cost_table(saved, found)
    names = names_in(joints_of_robot(robot))
    print_table("error in percent", *with_names(header, rows, names), numbers=range(1, len(header)))
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
