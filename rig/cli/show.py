"""Output of the command line: lines, tables, JSON. Results go to stdout, everything else to stderr."""

from __future__ import annotations

import errno
import json
import os
import sys
from typing import TYPE_CHECKING, Any, TextIO, cast

from rich.console import Console
from rich.markup import escape

from rig.procedures.present.as_json import finite
from rig.procedures.present.blocks import headline as headline_of
from rig.procedures.present.blocks import simulated_mark
from rig.procedures.present.terminal import show
from rig.procedures.present.visible import visible

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable
    from pathlib import Path

    from rich.text import Text

    from rig.procedures.present.blocks import Block
    from rig.procedures.tables.table import Table
    from rig.verbs.result import Reported, Result


class _Console(Console):
    def render_str(self, text: str, **options: Any) -> Text:
        """As rich, with control characters escaped: names and notes come from files of other people."""
        return super().render_str(visible(text), **options)

    def on_broken_pipe(self) -> None:
        """Leave it to `rig.cli.main`: the reader of our output has gone, which is not a fault."""
        raise BrokenPipeError


class _Outliving:
    """A standard stream that loses its text when its terminal or reader has gone; the command goes on.

    Args:
        stream: the stream.

    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, or lose, a text; returns its length."""
        self._or_lose(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Flush, if anybody reads it."""
        self._or_lose(self._stream.flush)

    def _or_lose(self, act: Callable[[], object]) -> None:
        try:
            act()
        except OSError as error:
            if error.errno not in (errno.EIO, errno.EPIPE):
                raise
            # Python keeps the text, and would fail again when it flushes at its end.
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, self._stream.fileno())
            os.close(null)


def outlive_readers() -> None:
    """Let this command go on, with its own exit code, when its terminal is closed (EIO) or its reader ends (EPIPE)."""
    sys.stdout = cast("TextIO", _Outliving(sys.stdout))
    sys.stderr = cast("TextIO", _Outliving(sys.stderr))


out = _Console(highlight=False, emoji=False)
err = _Console(stderr=True, highlight=False, emoji=False)


def print_json(value: object) -> None:
    """A result as JSON on stdout; NaN and infinity become null."""
    json.dump(finite(value), sys.stdout, indent=2, allow_nan=False)
    sys.stdout.write("\n")


mark = simulated_mark


def headline(file: str, table: Table, console: Console = out) -> None:
    """Sensors, number of observations, and whether the run continues."""
    show((headline_of(file, table),), console)


def show_notes(result: Result, but: Container[str] = ()) -> None:
    """Notes for readers: unused columns and rows, with reasons; without those that stand in its blocks."""
    for note in result.notes():
        if note in but:
            continue
        err.print(f"[yellow]{escape(note)}[/]", soft_wrap=True)


def show_result(result: Result, *, as_json: bool, blocks: Iterable[Block] | None = None) -> None:
    """A result on stdout, as these `blocks` if they are given, and its notes on stderr."""
    if as_json:
        print_json(result.to_json())
    else:
        show(result.blocks() if blocks is None else blocks, out)
    show_notes(result)


def write_report(result: Reported, path: Path | None) -> None:
    """Write the report of a result where one was asked for. Raises `UsageError` where it has none."""
    if path is not None:
        result.report(path)
        err.print(f"report: {escape(str(path))}", soft_wrap=True)
