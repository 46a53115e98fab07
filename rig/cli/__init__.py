"""The command line: `rig`."""

from __future__ import annotations

import errno
import io
import os
import sys
import tempfile
import traceback
from functools import cache

# Before any import of numpy: our matrices are narrow, and a second thread doubles the time (measured).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from typing import Annotated, Any

import typer
from typer.main import get_command

from rig.cli.commands import app
from rig.errors import ExitCode, NotSafe, RigError
from rig.procedures.errors import BrokenKind, DataError

# Typer contains click from 0.2x on and used the installed one before: this finds both.
_UsageProblem: type[Exception] = next(cls for cls in typer.BadParameter.__mro__ if cls.__name__ == "ClickException")


def _version(asked: bool) -> None:
    if asked:
        from rig import __version__  # noqa: PLC0415

        print(f"rig {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="show the version and exit")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        from rig.cli.home import home  # noqa: PLC0415

        home()


def main() -> None:
    """Entry point: run the command; turn errors for people into one message and an exit code."""
    _open_what_is_closed()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="surrogateescape")  # a path that is not text is printed unchanged
    try:
        code = _command()(standalone_mode=False)
        sys.stdout.flush()
    except (RigError, DataError, BrokenKind) as error:
        from rig.procedures.present.visible import visible  # noqa: PLC0415

        print(f"rig: {visible(str(error))}", file=sys.stderr)
        if isinstance(error, NotSafe) and isinstance(error.__cause__, Exception):
            print(f"rig: {_unforeseen(error.__cause__)}", file=sys.stderr)
        code = _exit_code(error)
    except _UsageProblem as error:
        error.show(file=sys.stderr)  # type: ignore[attr-defined]  # every ClickException has it
        code = ExitCode.USAGE
    except (typer.Abort, KeyboardInterrupt):
        code = _interrupted()
    except SystemExit as ended:
        # The command-line library makes exit code 1 of a reader that has gone, such as `head`.
        gone = isinstance(ended.__context__, BrokenPipeError)
        code = _unread() if gone else _interrupted() if ended.code == _BY_SIGINT else ended.code
    except BrokenPipeError:
        code = _unread()
    except OSError as error:
        too_long = error.errno == errno.ENAMETOOLONG  # the error belongs to an argument, in whatever function
        print(f"rig: {_name_too_long(error) if too_long else error}", file=sys.stderr)
        code = ExitCode.USAGE if too_long else ExitCode.FAULT
    except Exception as error:
        print(f"rig: {_unforeseen(error)}", file=sys.stderr)
        code = ExitCode.FAULT
    sys.exit(int(code) if isinstance(code, int) else 0)


@cache
def _command() -> Any:
    """All commands. Made once: each further time would read again the options of those that were called before."""
    return get_command(app)


class _ClosedOutput(io.TextIOBase):
    """Replacement of a closed standard output: a result must not be lost silently."""

    def write(self, _text: str) -> int:
        raise OSError(
            errno.EBADF, "the standard output is closed, so the result is lost: send it to a file, or to /dev/null"
        )


def _open_what_is_closed() -> None:
    """Keep the numbers of closed standard streams from the files opened next, and make print() report the loss."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number, which is this one
    if sys.stdin is None:
        sys.stdin = os.fdopen(0, encoding="utf-8")
    if sys.stdout is None:
        sys.stdout = _ClosedOutput()
    if sys.stderr is None:  # print() would treat None as standard output
        sys.stderr = os.fdopen(2, "w", encoding="utf-8")


def _exit_code(error: Exception) -> ExitCode:
    """Message of an error for people."""
    if isinstance(error, RigError):
        return error.exit_code
    return ExitCode.CONFIGURATION if isinstance(error, BrokenKind) else ExitCode.USAGE


_BY_SIGINT = 130
"""Exception of the command-line library after Ctrl-C."""


def _unread() -> ExitCode:
    """The reader of our output has gone; Python must not fail either when it flushes at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return ExitCode.DONE


def _interrupted() -> ExitCode:
    """Message of an interrupt outside a session: a session has its own."""
    print("rig: interrupted", file=sys.stderr)
    return ExitCode.INTERRUPTED


def _name_too_long(error: OSError) -> str:
    name = str(error.filename)
    shown = name if len(name) <= _SHOWN else f"{name[:_SHOWN]}..."
    return f"{shown} cannot be a file: its name is too long ({len(os.fsencode(name))} bytes); choose a shorter one"


_SHOWN = 100


def _unforeseen(error: Exception) -> str:
    """Keep the traceback of an unexpected error, and say where."""
    with tempfile.NamedTemporaryFile("w", prefix="rig-", suffix=".txt", delete=False) as file:
        traceback.print_exception(error, file=file)
    return (
        f"unforeseen: {type(error).__name__}: {error}. This is a defect of rig; report it with {file.name}. "
        f"Run files stay intact: `rig status RUN` shows the run, `rig resume RUN` continues it"
    )
