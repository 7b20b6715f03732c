"""The command line in the test's own process: what a user would see, without starting Python again."""

import contextlib
import io
from dataclasses import dataclass
from pathlib import Path

from ident.command_line.cli import run


@dataclass(frozen=True)
class Done:
    returncode: int
    stdout: str
    stderr: str


def here(*arguments: object, cwd: Path | None = None) -> Done:
    """Run `ident ARGUMENTS` as in the folder `cwd`."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd or Path.cwd()),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        status = run([str(a) for a in arguments])
    return Done(status, out.getvalue(), err.getvalue())
