"""The command line in the test's own process: what a user would see, without starting Python again."""

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ident.command_line.cli import run


@dataclass(frozen=True)
class Done:
    returncode: Any
    stdout: str
    stderr: str


def here(*arguments: object, cwd: Path | None = None, run: Callable[[list[str]], int] = run) -> Done:
    """Run `ident ARGUMENTS`, or another command line, as in the folder `cwd`."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd or Path.cwd()),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            status: Any = run([str(a) for a in arguments])
        except SystemExit as leave:
            status = leave.code
    return Done(status, out.getvalue(), err.getvalue())
