"""What both packages' commands share: being stopped, the exit status, one sentence, version, completion.

Exit status (contract 4): 0 done, 1 a check or a fit failed with a reason, 2 wrong usage or input, 130 stopped
by Ctrl-C. An error that is meant for the user carries `exit_status`; every other one is our mistake and is
raised. Nothing heavy is imported here, so that Ctrl-C is answered from the first moment on.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys

TYPE_CHECKING = False  # nothing that costs time: until this module is read, Ctrl-C finds nobody at home
if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import FrameType
    from typing import Any

STOPPED = 130
MODELS = {
    "A": "motor torque",
    "B": "joint torque sensor",
    "C": "both",
    "D": "their difference: the drive chain",
}


KEEN = ("strict", "surrogateescape")  # of a stream: what it cannot write is an error


def leave_on_signals(name: str) -> None:
    """End at Ctrl-C or SIGTERM at once, whatever is being imported or computed, and leave nothing half done.

    An exception would be lost in a C extension that is being imported, and in callbacks.
    """

    def stop(number: int, _: FrameType | None) -> None:
        for its in (signal.SIGINT, signal.SIGTERM):
            signal.signal(its, signal.SIG_IGN)
        output = sys.modules.get("modelgen.output")
        with contextlib.suppress(Exception):
            if output is not None:
                output.discard_all()
        with contextlib.suppress(Exception):
            sys.stdout.flush()
        clear = "\r\x1b[K\x1b[?25h" if os.isatty(2) else ""  # a bar hides the cursor
        with contextlib.suppress(OSError):
            os.write(2, f"{clear}{name}: stopped; nothing was left half written\n".encode())
        os._exit(128 + number)

    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
            signal.signal(number, stop)


def run(name: str, app: Callable[[], Any], arguments: list[str] | None = None) -> int:
    """Run the command line that `app()` imports; return its exit status instead of leaving."""
    for stream in ("stdout", "stderr"):
        if getattr(sys, stream) is None:  # closed by who called: `ident fit study.yaml >&-`
            setattr(sys, stream, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(its := getattr(sys, stream), io.TextIOWrapper) and its.errors in KEEN:
            its.reconfigure(errors="replace")  # a terminal of seven bits takes no degree sign
    try:
        status = app()(args=arguments, prog_name=name, standalone_mode=False) or 0
        if sys.stdout is not None:
            sys.stdout.flush()
        return _stopped(name) if status == STOPPED else status  # typer turns Ctrl-C into this status itself
    except KeyboardInterrupt:
        return _stopped(name)
    except BrokenPipeError:
        sys.stdout = None  # whoever read our output has left, as `head` does
        return 0
    except Exception as error:
        return _answer(name, error)


def _answer(name: str, error: Any) -> int:
    """One sentence and the status for an error that is the user's; others are raised."""
    if type(error).__name__ == "Abort":  # typer's own
        return _stopped(name)
    if hasattr(error, "exit_code") and not hasattr(error, "format_message"):  # typer's Exit
        return error.exit_code
    if hasattr(error, "format_message"):  # wrong usage
        text = error.format_message()
        if not text:
            return 2  # the help was shown instead
        context = getattr(error, "ctx", None)
        command = context.command_path if context is not None else name
        return _say(f"{name}: {text.rstrip('.')}; see {command} --help", 2)
    if hasattr(error, "exit_status"):
        return _say(f"{name}: {error}", error.exit_status)
    if isinstance(error, OSError):
        sys.stdout = None if error.errno == 28 and error.filename is None else sys.stdout
        what = f"{error.filename}: " if error.filename else ""
        return _say(f"{name}: {what}{error.strerror or error}; name another file, or folder with -o", 2)
    if isinstance(error, MemoryError):
        return _say(f"{name}: there is not enough free memory; give fewer or shorter recordings", 2)
    raise error


def _stopped(name: str) -> int:
    return _say(f"{name}: stopped; nothing was left half written", STOPPED)


def _say(text: str, status: int) -> int:
    sentence = " ".join(text.split())
    if len(sentence) > 2000:
        sentence = f"{sentence[:900]} ... {sentence[-900:]}"
    with contextlib.suppress(OSError):
        print(sentence, file=sys.stderr)
    return status


def show_version(wanted: bool) -> None:
    """Callback of --version."""
    if wanted:
        from importlib.metadata import version

        import typer

        print(f"dynident {version('dynident')}")
        raise typer.Exit()


def robot_names(incomplete: str) -> list[str]:
    """Built-in robots, for completion."""
    from pathlib import Path

    files = Path(__file__).parent.joinpath("robots").iterdir()
    names = (path.stem for path in files if path.suffix in (".yaml", ".urdf"))
    return sorted(name for name in names if name.startswith(incomplete))


def model_names(incomplete: str) -> list[tuple[str, str]]:
    return [(name, text) for name, text in MODELS.items() if name.startswith(incomplete.upper())]


def effect_names(incomplete: str) -> list[str]:
    from modelgen.effects import catalogue

    return sorted(name for name in catalogue() if name.startswith(incomplete))


def folder(given: str | Path) -> Path:
    """The value of -o, or its default. Raises OutputError for what names no folder."""
    from pathlib import Path

    from modelgen.output import OutputError

    text = str(given)
    if not text.strip():
        raise OutputError("-o is empty; name a folder, as in -o out")
    if "\0" in text:
        raise OutputError("-o: a name has no zero byte; name another folder")
    return Path(text)
