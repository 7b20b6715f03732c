"""The command `ident`; what it takes is imported when Ctrl-C is heard."""

import gc
import os
import sys

from modelgen import command_line

TYPE_CHECKING = False  # typing's own costs 5 ms, in which Ctrl-C would find nobody at home
if TYPE_CHECKING:
    from typing import Any

os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # gives back what a recording's blocks took
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")  # a search through every installed package for none

# of commands, in the order of the help
FILES = ("fitting", "robots", "inspecting", "exciting", "kept_fits", "fleet", "demo")
YOUNG = 200_000  # objects more before garbage is looked for: imports make many, and none of them is


def commands() -> "Any":
    """The app with all its commands."""
    from importlib import import_module

    from ident.command_line.app import app

    for name in FILES:
        import_module(f"ident.command_line.{name}")
    return app


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status. Every error becomes one sentence on stderr."""
    return command_line.run("ident", commands, arguments)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit status."""
    command_line.leave_on_signals("ident")
    gc.set_threshold(YOUNG)
    status = run(arguments)
    gc.freeze()  # the system takes all of it back at once: nothing is searched for garbage on the way out
    sys.exit(status)


if __name__ == "__main__":
    main()
