"""How the command line shows things: durations, progress, tables. Results to stdout, everything else to stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

from rig.engine.session import Progress as News

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)


def duration(seconds: float) -> str:
    """Seconds for people: 45 s, 12 min, 27 h 58 min."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def print_json(value: object) -> None:
    """A result as JSON on stdout; NaN and infinity become null, which JSON has."""
    json.dump(_finite(value), sys.stdout, indent=2, allow_nan=False)
    sys.stdout.write("\n")


def _finite(value: object) -> object:
    if isinstance(value, float):
        return value if abs(value) != float("inf") and value == value else None  # noqa: PLR0124 - NaN is not itself
    if isinstance(value, Mapping):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    return value


def mark(simulated: bool) -> str:
    """What is put beside everything that comes from a simulated run."""
    return "[bold magenta]SIMULATED[/] " if simulated else ""


class _BenchTime(ProgressColumn):
    def render(self, task: Task) -> Text:
        """Elapsed and remaining bench time."""
        left = task.fields.get("left")
        text = f"{duration(task.fields.get('spent', 0.0))} of bench time"
        return Text(text + (f", {duration(left)} left" if left is not None else ""))


@contextmanager
def run_progress(*, simulated: bool) -> Iterator[Any]:
    """A progress bar on stderr fed by the sequencer's news; plain lines where stderr is no terminal."""
    if not err.is_terminal:
        yield _PlainProgress(simulated).show
        return
    columns = (
        TextColumn(f"{mark(simulated)}{{task.fields[state]:<10}}"),
        BarColumn(),
        TextColumn("{task.completed}/{task.total} points"),
        _BenchTime(),
        TextColumn("[yellow]{task.fields[message]}"),
    )
    # Redirecting would send the run file's path, our one line on stdout, to stderr with the bar.
    with Progress(*columns, console=err, refresh_per_second=5, redirect_stdout=False, redirect_stderr=False) as bar:
        task = bar.add_task("run", total=1, state="starting", message="", spent=0.0, left=None)

        def show(news: News) -> None:
            bar.update(
                task,
                completed=news.done,
                total=news.total,
                state=news.state,
                message=news.message,
                spent=news.elapsed_s,
                left=news.remaining_s,
            )

        yield show


class _PlainProgress:
    """One line per tenth of the run and per message, for logs."""

    def __init__(self, simulated: bool) -> None:
        self._mark = "SIMULATED " if simulated else ""
        self._tenth = -1
        self._message = ""

    def show(self, news: News) -> None:
        tenth = 10 * news.done // max(1, news.total)
        if tenth != self._tenth or (news.message and news.message != self._message):
            left = "" if news.remaining_s is None else f", {duration(news.remaining_s)} left"
            text = f"{self._mark}{news.state}: {news.done}/{news.total} points, {duration(news.elapsed_s)}{left}"
            print(f"{text} {news.message}".rstrip(), file=sys.stderr, flush=True)
        self._tenth, self._message = tenth, news.message
