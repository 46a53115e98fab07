"""`rig` as somebody types it, in this process: a second quicker than a new one, and warnings are errors here too.

What only a process of its own shows (kills, signals, terminals) starts one: `in_its_own_process`, or `kills.rig`.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch


@dataclass(frozen=True)
class Done:
    """What a command said, and what it ended with."""

    returncode: int
    stdout: str
    stderr: str


def rig(*arguments: object, cwd: Path | None = None, env: dict[str, str] | None = None) -> Done:
    """Run a command in folder `cwd`, with the environment variables `env` beside ours."""
    from rig.cli import main  # noqa: PLC0415 - where another kind is installed meanwhile, there is another (outside_package)

    said, told = io.StringIO(), io.StringIO()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    with (
        patch.object(sys, "argv", ["rig", *map(str, arguments)]),
        patch.dict(os.environ, env or {}),
        contextlib.chdir(cwd or "."),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(told),
    ):
        try:
            main()
        except SystemExit as ended:
            code = ended.code
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
    return Done(int(code or 0), said.getvalue(), told.getvalue())


def in_its_own_process(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command as `rig` does, and wait for its end, in folder `cwd`."""
    command = [sys.executable, "-m", "rig", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)
