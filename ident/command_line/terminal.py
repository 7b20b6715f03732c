"""What the command line shows: a progress bar on a terminal, tables, and nothing of either in a pipe."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from modelgen.terminal import progress as progress_bar

__all__ = ["print_table", "progress_bar", "say_checks", "say_notes", "say_warnings"]


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table on stdout: ruled on a terminal, tab-separated in a pipe (`cut` and `awk` can read it)."""
    if not sys.stdout.isatty():
        print("\t".join(columns))
        for row in rows:
            print("\t".join(row))
        return
    from rich.console import Console
    from rich.table import Table

    from ident.report.wording import holds_numbers

    table = Table(title=title, title_justify="left", title_style="bold")
    for k, column in enumerate(columns):
        table.add_column(column, justify="right" if holds_numbers(rows, k) else "left")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def say_checks(*documents: Mapping[str, Any]) -> None:
    """What was found in the data, before anything else, on stderr."""
    from ident.report.joints import names_of
    from ident.report.wording import check_sentences

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
