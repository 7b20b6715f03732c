"""The command `regenerate-model`; what it takes stands in `app.py`, imported when Ctrl-C is heard."""

from __future__ import annotations

import sys

from modelgen import command_line

NAME = "regenerate-model"


def _app() -> object:
    from modelgen.app import app

    return app


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status. Every error becomes one sentence on stderr."""
    return command_line.run(NAME, _app, arguments)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit status."""
    command_line.leave_on_signals(NAME)
    sys.exit(run(arguments))


if __name__ == "__main__":
    main()
