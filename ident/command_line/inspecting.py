"""`ident inspect`: tables on the terminal, a first study and a page beside it."""

import sys
from collections.abc import Sequence
from pathlib import Path

from ident.command_line.terminal import print_table, progress_bar


def inspect(
    recordings: Sequence[Path],
    robot: str | None,
    output: Path | None,
    topic: str | None,
    exact: bool,
    overwrite: bool,
    verbose: bool,
) -> None:
    """Look, say what was seen, write the study (and its page) where a file is named."""
    from ident.inspection import page as shown
    from ident.inspection.inspection import inspect_recordings
    from ident.output import OutputError, beside, write_file
    from ident.report.joints import named
    from ident.report.render import render

    page = beside(output, ".html") if output is not None else None
    for target in (output, page):
        if target is not None and target.exists() and not overwrite:
            raise OutputError(f"{target} is there already; name another file, or give --overwrite")
        if target is not None and any(target.resolve() == path.resolve() for path in recordings):
            raise OutputError(f"{target} is an input of this command; name another file with -o")
    folder = output.parent if output is not None else Path()
    with progress_bar(verbose) as progress:
        inspection = inspect_recordings(recordings, robot, folder, progress, topic, exact)
    for note in inspection.robot_notes:
        print(f"note: {note}", file=sys.stderr)
    for text, _ in shown.remarks(inspection):
        print(text, file=sys.stderr)
    study = inspection.study
    if found := shown.remarks(inspection):
        study += "# What was found in the recordings:\n" + "".join(f"#   {text}\n" for text, _ in found)
    header, rows = shown.log_rows(inspection)
    print_table("recordings", header, rows, numbers=range(1, len(header)))
    for log in inspection.logs:
        header, rows = shown.column_rows(log)
        print_table(log.label, header, rows, numbers=range(2, len(header)))
    if inspection.excitation is not None:
        print(named(inspection.excitation.sentence, inspection.joints))
        header, weakest = shown.excitation_rows(inspection)
        said = [tuple(named(cell, inspection.joints) for cell in row) for row in weakest]
        print_table("parameters shown least", header, said, numbers=(1,))
    if output is None or page is None:
        print(study)
        return
    write_file(output, study, overwrite=overwrite)
    write_file(page, render(shown.page(inspection, output.name)), overwrite=overwrite)
    print(f"wrote {output} and {page}")
    print(shown.next_step(inspection, str(output)))
