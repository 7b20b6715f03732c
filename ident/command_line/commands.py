"""What the commands of `ident` do: a thin shell over the door. Check, call, write, say what came."""

import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import ident
from ident.api.study import inputs_of
from ident.command_line.terminal import print_table, progress_bar
from ident.output import staged
from ident.report.joints import named, names_of, with_names
from ident.report.wording import check_sentence, check_sentences

# SciPy takes in all that NumPy names, with f2py a Fortran parser and a guesser of encodings: 60 ms and 7 MB.
# A name that is there is not looked up; who imports numpy.f2py gets it as ever.
np.f2py = ModuleType("numpy.f2py")  # type: ignore[attr-defined]


def simulate(robot: str, output: Path, overwrite: bool, verbose: bool, **options: Any) -> None:
    """`ident simulate`: recordings and a study; the hidden truth is written beside them."""
    parameters = options.get("parameters")
    inputs = [Path(robot), *([parameters] if parameters else [])]
    staging = staged(output, "ident simulate", overwrite=overwrite, inputs=inputs)
    with staging as stage, progress_bar(verbose) as progress:
        made = ident.simulate(robot, progress=progress, **options)
        made.save(stage)
    header, rows = made.table()
    rows = [(f"{row[0]}.parquet", *row[1:]) for row in rows]
    say_notes(made.result.robot.remarks)
    print_table(made.result.robot.name, header, rows, numbers=(3, 4))
    print(f"wrote {output / 'study.yaml'}; next: ident diagnose {output / 'study.yaml'} -o RESULTS")


def fit(study_file: Path, output: Path, models: tuple[str, ...], overwrite: bool, verbose: bool) -> None:
    """`ident fit`: identify, write fit.json, tables, plots and the report, show the result."""
    study = ident.load(study_file)  # before the slower imports: a slip is told at once
    staging = staged(output, "ident fit", overwrite=overwrite, inputs=inputs_of(study))
    with staging as stage, progress_bar(verbose) as progress:
        result: ident.Fit | ident.Comparison
        if models:
            result = ident.compare(study, models, progress=progress)
        else:
            result = ident.fit(study, progress=progress)
        progress("writing tables, plots and report")
        result.write(stage)
    from ident.report.fit_report import left_over

    documents = {model: each.document() for model, each in result.fits.items()}
    names = names_of(next(iter(documents.values())))
    say_notes(note for each in result.fits.values() for note in each.result.columns.model.notes)
    say_checks(*documents.values())
    for title, header, rows in result.tables():
        show(title, *with_names(header, rows, names))
    checks = [check_sentence(check) for document in documents.values() for check in document["checks"]]
    warnings = [text for text in result.warnings if not any(told.endswith(text) for told in checks)]
    say_warnings([named(text, names) for text in warnings])
    for model, document in documents.items():
        print((f"Model {model}. " if models else "") + named(left_over(document), names))
    print(f"wrote {output / 'report.html'}; next: ident diagnose {study_file} -o RESULTS")


def diagnose(study_file: Path, output: Path, memory: str | None, overwrite: bool, verbose: bool) -> None:
    """`ident diagnose`: find what the model lacks, write diagnosis.json, plots and the report, show it."""
    study = ident.load(study_file)
    staging = staged(output, "ident diagnose", overwrite=overwrite, inputs=inputs_of(study))
    with staging as stage, progress_bar(verbose) as progress:
        diagnosis = ident.diagnose(study, progress=progress, memory=memory)
        progress("writing plots and report")
        diagnosis.write(stage)
    from ident.report.diagnosis_words import before_and_after, told, verdict, visible_in_words

    document = diagnosis.document()
    say_notes(diagnosis.result.first.columns.model.notes)
    say_checks(document)
    remedies = [f"What to do: {f['remedy']}." for f in document["findings"] if f["remedy"]]
    names = names_of(document)
    for text in filter(None, (verdict(document), *told(document), visible_in_words(document))):
        print(named(text, names))
    for text in dict.fromkeys(remedies):
        print(text)
    show("error in percent", *with_names(*before_and_after(document), names))
    say_warnings([named(text, names) for text in diagnosis.result.notes])
    if any(f["equivalent"] for f in document["findings"]):
        from ident.diagnosis.requests import robot_of

        command = f"ident excite {shlex.quote(robot_of(diagnosis.result.study))} --from {output} -o MOTION"
        print(f"next: {command} designs the experiment that tells the explanations apart")
    last = f"; ident fit {output / 'extended_study.yaml'} gives the errors after again"
    print(f"wrote {output / 'report.html'}{last if document['verdict'] == 'effect' else ''}")
    print(f"next: ident export {output} --urdf FILE (or --mjcf, --c) writes the robot as it was identified")


def robot(file: str, output: Path, exact: bool, overwrite: bool) -> None:
    """`ident robot`: a URDF or a table as a robot file."""
    from ident.output import OutputError, write_file
    from modelgen.geometry.robot_text import robot_text

    if output.exists() and Path(file).exists() and output.samefile(file):
        raise OutputError(f"{output} is the input of this command; name another file with -o")
    text, remarks = robot_text(file, exact)
    write_file(output, text, overwrite=overwrite)
    say_notes(remarks)
    print(f"wrote {output}; next: regenerate-model {output} --rules-only")


def demo(output: Path, overwrite: bool, verbose: bool) -> None:
    """`ident demo`: a simulated robot hides an effect; find it, show the error before and after."""
    from ident.command_line.demo import OPENING, answer, record

    print(f"{OPENING}\n")
    staging = staged(output, "ident demo", overwrite=overwrite)
    with staging as stage, progress_bar(verbose) as progress:
        recorded = record(stage, progress)
    diagnose(output / "study.yaml", output / "results", None, overwrite, verbose)
    print(f"What was hidden: {answer(recorded)}.")


def show(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table whose first column is a name and whose others are numbers, but for a unit and remarks."""
    words = ("unit", "physics", "joint")
    print_table(title, header, rows, numbers=[k for k, name in enumerate(header) if k and name not in words])


def say_checks(*documents: Mapping[str, Any]) -> None:
    """What was found in the data, before anything else, on stderr."""
    checks = [sentence for document in documents
              for sentence in check_sentences(document.get("checks", ()), names_of(document))]  # fmt: skip
    for sentence in dict.fromkeys(checks):
        print(sentence, file=sys.stderr)


def say_notes(notes: Iterable[str]) -> None:
    """What was rounded in reading a robot, and the like."""
    for note in dict.fromkeys(notes):
        print(f"note: {note}", file=sys.stderr)


def say_warnings(warnings: Sequence[str]) -> None:
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
