"""Progress on stderr: of a run, and of many tasks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.text import Text

from rig.cli.show import err, mark
from rig.drivers.clock import RealClock
from rig.procedures.present.durations import duration
from rig.procedures.present.visible import visible

if TYPE_CHECKING:
    from rich.console import RenderableType

    from rig.engine.session import Progress as News


class _Bar(Progress):
    """Two lines that never wrap: state, bar, points and time left; below them bench time and present activity."""

    def get_renderables(self) -> Iterable[RenderableType]:
        for task in self.tasks:
            yield self.make_tasks_table([task])
            words = Text(f"  {duration(task.fields['spent'])} of bench time", no_wrap=True, overflow="ellipsis")
            if task.fields["message"]:
                words.append(f"  {task.fields['message']}", "yellow")
            yield words


@contextmanager
def run_progress(*, simulated: bool) -> Iterator[Callable[[News], None]]:
    """A function for the sequencer's progress: a progress bar on stderr, or plain lines without a terminal.

    The bar appears with the first progress. So the run file's path is on stdout, on a separate line, before the bar is
    drawn on the same terminal.
    """
    if not err.is_terminal:
        yield _PlainProgress(simulated).show
        return
    columns = (
        TextColumn(f"{mark(simulated)}{{task.fields[state]:<10}}"),
        BarColumn(bar_width=None),
        TextColumn("{task.completed}/{task.total} points"),
        TextColumn("{task.fields[left]}"),
    )
    # Redirecting would send the run file's path, our only line on stdout, to stderr with the bar.
    bar = _Bar(*columns, console=err, refresh_per_second=5, redirect_stdout=False, redirect_stderr=False, expand=True)

    def show(news: News) -> None:
        fields: dict[str, Any] = {
            "completed": news.done,
            "total": news.total,
            "state": news.state,
            "message": f"{news.message}  {news.detail}".rstrip(),
            "spent": news.elapsed_s,
            "left": "" if news.remaining_s is None else f"{duration(news.remaining_s)} left",
        }
        if not bar.tasks:
            bar.add_task("run", **fields)
            bar.start()
        bar.update(bar.tasks[0].id, **fields)

    try:
        yield show
    finally:
        bar.stop()


@contextmanager
def counting(what: str, total: int) -> Iterator[Callable[[str], None]]:
    """A function to call after each of many tasks: a bar with remaining time on stderr.

    Without a terminal it prints one line per minute.
    """
    stopwatch = RealClock().stopwatch
    began = told = stopwatch()
    done = 0

    def plain(words: str) -> None:
        nonlocal done, told
        done += 1
        now = stopwatch()
        if now - told > _EVERY_S and done < total:
            told = now
            left = duration((now - began) / done * (total - done))
            print(visible(f"{what}: {done}/{total}, {words}, {left} left"), file=sys.stderr, flush=True)

    if not err.is_terminal:
        yield plain
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("{task.fields[words]}"),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=err, refresh_per_second=5, expand=True) as bar:
        task = bar.add_task(what, total=total, words="")
        yield lambda words: bar.update(task, advance=1, words=words)


_EVERY_S = 60.0


_BY_HAND = "to do by hand: "
_ANSWERED_S = 1.0
"""A simulated person has answered by then, in real seconds."""


class _PlainProgress:
    """One line per tenth of the run and per message, for logs."""

    def __init__(self, simulated: bool) -> None:
        self._mark = "SIMULATED " if simulated else ""
        self._tenth = -1
        self._message = ""
        self._stopwatch = RealClock().stopwatch
        self._asked, self._asked_s = "", 0.0

    def show(self, news: News) -> None:
        if self._mark and news.message.startswith(_BY_HAND) and not self._lasts(news.message):
            return  # a simulated person answers at once
        tenth = 10 * news.done // max(1, news.total)
        said = news.message and news.message != self._message
        if said or (tenth != self._tenth and news.state != "preparing"):
            left = "" if news.remaining_s is None else f", {duration(news.remaining_s)} left"
            text = f"{self._mark}{news.state}: {news.done}/{news.total} points, {duration(news.elapsed_s)}{left}"
            print(visible(f"{text} {news.message}".rstrip()), file=sys.stderr, flush=True)
        self._tenth, self._message = tenth, news.message

    def _lasts(self, asked: str) -> bool:
        """Whether a person has been asked for this for some time."""
        if asked != self._asked:
            self._asked, self._asked_s = asked, self._stopwatch()
        return self._stopwatch() - self._asked_s >= _ANSWERED_S
