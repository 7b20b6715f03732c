"""What the commands of `ident` do: read, call the pure part with a progress bar, write, say what came out."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ident.command_line.terminal import print_table, progress_bar
from ident.output import staged


def simulate(
    robot: str,
    output: Path,
    model: str,
    effects: tuple[str, ...],
    payload: float | None,
    seed: int,
    parameters: Path | None,
    overwrite: bool,
    verbose: bool,
) -> None:
    """`ident simulate`: recordings and a study; the hidden truth is written beside them."""
    from ident.simulate import simulate, write_simulation

    inputs = [Path(robot), *([parameters] if parameters else [])]
    staging = staged(output, "ident simulate", overwrite=overwrite, inputs=inputs)
    with staging as stage, progress_bar(verbose) as progress:
        made = simulate(robot, model, effects, payload, seed, parameters, progress=progress)
        write_simulation(made, stage)
    rows = []
    for recording in made.recordings:
        t = recording.columns["t"]
        rows.append(
            (
                f"{recording.label}.parquet",
                recording.use,
                recording.payload or "",
                f"{t[-1] - t[0]:.0f}",
                str(len(t)),
            )
        )
    print_table(made.robot.name, ("recording", "use", "payload", "seconds", "samples"), rows, numbers=(3, 4))
    print(f"wrote {output / 'study.yaml'}; next: ident diagnose {output / 'study.yaml'} -o RESULTS")


def fit(study_file: Path, output: Path, models: tuple[str, ...], overwrite: bool, verbose: bool) -> None:
    """`ident fit`: identify, write fit.json, tables, plots and the report, show the result."""
    from ident.recordings.study import load_study

    study = load_study(study_file)  # before the slower imports: a slip is told at once
    models = checked_models(models)
    from ident.estimation.fit import fit_models, fit_study
    from ident.report.files import (
        comparison_table,
        error_table,
        parameter_table,
        write_comparison,
        write_into,
    )
    from ident.report.fit_result import comparison_html, fit_html

    staging = staged(output, "ident fit", overwrite=overwrite, inputs=inputs_of(study))
    with staging as stage, progress_bar(verbose) as progress:
        if models:
            results = fit_models(study, models, progress=progress)
            progress("writing tables, plots and reports")
            write_comparison(results, stage)
            for model, result in results.items():
                (stage / model / "report.html").write_text(fit_html(result), encoding="utf-8")
            (stage / "report.html").write_text(comparison_html(results), encoding="utf-8")
        else:
            result = fit_study(study, progress=progress)
            progress("writing tables, plots and report")
            write_into(result, stage)
            (stage / "report.html").write_text(fit_html(result), encoding="utf-8")
    if models:
        show("parameters", comparison_table(results))
        warnings = [f"model {model}: {text}" for model, result in results.items() for text in result.warnings]
    else:
        show("essential parameters", parameter_table(result))
        show("relative error", error_table(result))
        warnings = list(result.warnings)
    finish(warnings, output)


def inputs_of(study: Any) -> list[Path]:
    """The files that a study is made of; none is ever written to."""
    files = [study.recording_path(entry) for entry in study.recordings]
    return [study.file, Path(study.robot_source), *files]


def checked_models(models: tuple[str, ...]) -> tuple[str, ...]:
    """Upper-case model letters. Raises StudyError for one that is none of A, B, C, D."""
    from ident.errors import IdentError
    from ident.recordings.study import MODELS

    letters = tuple(dict.fromkeys(model.strip().upper() for model in models))
    for letter in letters:
        if letter not in MODELS:
            raise IdentError(f"--models {letter}: there is no such model; choose from {', '.join(MODELS)}")
    return letters


def show(title: str, table: tuple[Sequence[str], Sequence[Sequence[str]]]) -> None:
    """A table whose first column is a name and whose others are numbers, but for a unit."""
    header, rows = table
    print_table(title, header, rows, numbers=[k for k, name in enumerate(header) if k and name != "unit"])


def finish(warnings: list[str], output: Path) -> None:
    """Warnings on stderr, and where the report is."""
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    print(f"wrote {output / 'report.html'}")


def diagnose(study_file: Path, output: Path, overwrite: bool, verbose: bool) -> None:
    """`ident diagnose`: find what the model lacks, write diagnosis.json, plots and the report, show it."""
    from ident.recordings.study import load_study

    study = load_study(study_file)
    from ident.diagnosis import diagnose_study
    from ident.diagnosis.document import diagnosis_document
    from ident.diagnosis.regenerated import with_regenerated, write_model
    from ident.report.diagnosis_plots import draw_all
    from ident.report.diagnosis_report import (
        finding_sentence,
        regenerated_sentence,
        unexplained_sentence,
        verdict,
    )
    from ident.report.diagnosis_result import diagnosis_html
    from ident.report.files import write_csv, write_document

    staging = staged(output, "ident diagnose", overwrite=overwrite, inputs=inputs_of(study))
    with staging as stage, progress_bar(verbose) as progress:
        diagnosis = with_regenerated(diagnose_study(study, progress), progress)
        diagnosis = write_model(diagnosis, stage / "model")
        progress("writing plots and report")
        document = diagnosis_document(diagnosis)
        write_document(stage / "diagnosis.json", document)
        write_csv(stage / "errors.csv", before_and_after(document))
        draw_all(diagnosis, document, stage / "plots")
        (stage / "report.html").write_text(diagnosis_html(diagnosis), encoding="utf-8")
    print(verdict(document))
    for finding in document["findings"]:
        print(finding_sentence(document, finding))
    for item in document["unexplained"]:
        print(unexplained_sentence(item))
    if regenerated_sentence(document):
        print(regenerated_sentence(document))
    show("error in percent", before_and_after(document))
    finish(list(document["notes"]), output)


def before_and_after(document: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of the error table: per channel before and after for each role, and the noise floor."""
    before, after = document["error_percent"]["before"], document["error_percent"]["after"]
    floor = document["noise_floor_percent"]
    header = (
        "channel",
        *(f"{role} {when}" for role in before for when in ("before", "after")),
        "noise floor",
    )
    rows = []
    for channel in next(iter(before.values())):
        values = [f"{block[role][channel]:.2f}" for role in before for block in (before, after)]
        rows.append((channel, *values, f"{floor[channel]:.2f}" if channel in floor else ""))
    return header, rows


def demo(output: Path, overwrite: bool, verbose: bool) -> None:
    """`ident demo`: a simulated robot hides an effect; find it, show the error before and after."""
    from ident.command_line.demo import OPENING, answer, record

    print(f"{OPENING}\n")
    staging = staged(output, "ident demo", overwrite=overwrite)
    with staging as stage, progress_bar(verbose) as progress:
        recorded = record(stage, progress)
    diagnose(output / "study.yaml", output / "results", overwrite, verbose)
    print(f"What was hidden: {answer(recorded)}.")
