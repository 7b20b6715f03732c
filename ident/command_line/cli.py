"""The command `ident`; what it takes stands in `app.py`, which is imported when Ctrl-C is heard."""

import gc
import os
import sys

from modelgen import command_line

os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # gives back what a recording's blocks took
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")  # a search through every installed package for none

YOUNG = 200_000  # objects more before garbage is looked for: imports make many, and none of them is


def _app() -> object:
    from ident.command_line.app import app

    return app


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status. Every error becomes one sentence on stderr."""
    return command_line.run("ident", _app, arguments)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit status."""
    command_line.leave_on_signals("ident")
    gc.set_threshold(YOUNG)
    status = run(arguments)
    gc.freeze()  # the system takes all of it back at once: nothing is searched for garbage on the way out
    sys.exit(status)


if __name__ == "__main__":
    main()
