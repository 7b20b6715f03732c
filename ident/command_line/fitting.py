"""`ident fit` and `ident diagnose`: check, call, write, say what came."""

import shlex
from typing import Annotated

from ident.command_line.app import Output, Overwrite, Study, Verbose, app, option
from ident.command_line.terminal import print_table, progress_bar, say_checks, say_notes, say_warnings


@app.command(
    epilog="Example: [bold]ident fit study.yaml -o out[/bold]   then open out/report.html\n\n"
    "The paper's Table II in one call: [bold]ident fit study.yaml --models A,B,C,D -o out[/bold]"
)
def fit(
    study: Study,
    output: Output,
    models: Annotated[
        str | None, option("--models", help="Fit several models and compare them, for example A,B,C,D.")
    ] = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
) -> None:
    """Identify the base parameters: fit.json, tables, plots and report.html.

    The study says which robot, which model (A motor torque, B joint torque sensor, C both, D their
    difference) and which recordings are fitted (identify), decide what is kept (validate) or are only
    reported (test).
    """
    from ident.api.study import inputs_of
    from ident.command_line.light import ident
    from ident.output import staged
    from ident.report.joints import named, names_of, with_names
    from ident.report.wording import check_sentence

    loaded = ident.load(study)  # before the slower imports: a slip is told at once
    staging = staged(output, "ident fit", overwrite=overwrite, inputs=inputs_of(loaded))
    with staging as stage, progress_bar(verbose) as progress:
        result: ident.Fit | ident.Comparison
        if models:
            result = ident.compare(loaded, tuple(models.split(",")), progress=progress)
        else:
            result = ident.fit(loaded, progress=progress)
        progress("writing tables, plots and report")
        result.write(stage)
    from ident.report.fit_report import left_over

    documents = {model: each.document() for model, each in result.fits.items()}
    names = names_of(next(iter(documents.values())))
    say_notes(note for each in result.fits.values() for note in each.result.columns.model.notes)
    say_checks(*documents.values())
    for title, header, rows in result.tables():
        print_table(title, *with_names(header, rows, names))
    checks = [check_sentence(check) for document in documents.values() for check in document["checks"]]
    warnings = [text for text in result.warnings if not any(told.endswith(text) for told in checks)]
    say_warnings([named(text, names) for text in warnings])
    for model, document in documents.items():
        print((f"Model {model}. " if models else "") + named(left_over(document), names))
    print(f"wrote {output / 'report.html'}; next: ident diagnose {study} -o RESULTS")


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
    from ident.api.study import inputs_of
    from ident.command_line.light import ident
    from ident.output import staged
    from ident.report.joints import named, names_of, with_names

    loaded = ident.load(study)
    staging = staged(output, "ident diagnose", overwrite=overwrite, inputs=inputs_of(loaded))
    with staging as stage, progress_bar(verbose) as progress:
        diagnosis = ident.diagnose(loaded, progress=progress, memory=memory)
        progress("writing plots and report")
        diagnosis.write(stage, output)
    from ident.report.finding_words import before_and_after, visible_in_words
    from ident.report.verdict_words import told, verdict

    document = diagnosis.document(output)
    say_notes(diagnosis.result.first.columns.model.notes)
    say_checks(document)
    remedies = [f"What to do: {f['remedy']}." for f in document["findings"] if f["remedy"]]
    names = names_of(document)
    for text in filter(None, (verdict(document), *told(document), visible_in_words(document))):
        print(named(text, names))
    for text in dict.fromkeys(remedies):
        print(text)
    print_table("error in percent", *with_names(*before_and_after(document), names))
    say_warnings([named(text, names) for text in diagnosis.result.notes])
    if any(f["equivalent"] for f in document["findings"]):
        from ident.diagnosis.telling.requests import robot_of

        command = f"ident excite {shlex.quote(robot_of(diagnosis.result.study))} --from {output} -o MOTION"
        print(f"next: {command} designs the experiment that tells the explanations apart")
    last = f"; ident fit {output / 'extended_study.yaml'} gives the errors after again"
    print(f"wrote {output / 'report.html'}{last if document['verdict'] == 'effect' else ''}")
    print(f"next: ident export {output} --urdf FILE (or --mjcf, --c) writes the robot as it was identified")
