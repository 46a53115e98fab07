"""A bar for evaluations that take longer than a second: their steps, and the time left."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from rig.cli.show import err
from rig.drivers.clock import RealClock
from rig.fitter.steps import heard
from rig.procedures.present.durations import duration
from rig.procedures.present.visible import visible

_APPEARS_S, _EVERY_S = 1.0, 60.0
"""Seconds before a bar appears, and between lines of a log."""


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """A bar on stderr while the work inside tells its steps; it is gone with its end. A line per minute in a log.

    Args:
        what: is done, such as "tracing".
    """
    stopwatch = RealClock().stopwatch
    began = told = stopwatch()
    furthest = 0.0

    draw: Callable[[float, str], None] | None = None
    with ExitStack() as shown:

        def tell(done: float, words: str) -> None:
            nonlocal furthest, told, draw
            furthest = max(furthest, done)  # a search that begins anew takes nothing back
            now = stopwatch()
            left = "" if not furthest else f"{duration((now - began) / furthest * (1.0 - furthest))} left  "
            if err.is_terminal and now - began > _APPEARS_S:
                draw = draw or shown.enter_context(_bar(what))
                draw(furthest, visible(f"{left}{words}"))
            elif not err.is_terminal and now - told > _EVERY_S:
                told = now
                print(visible(f"{what}: {left}{words}"), file=sys.stderr, flush=True)

        with heard(tell):
            yield


@contextmanager
def _bar(what: str) -> Iterator[Callable[[float, str], None]]:
    from rich.progress import BarColumn, Progress, TextColumn  # noqa: PLC0415 - few commands take so long

    columns = (TextColumn("{task.description}"), BarColumn(bar_width=20), TextColumn("{task.fields[words]}"))
    # Redirecting would send what comes on stdout to stderr with the bar.
    with Progress(*columns, console=err, transient=True, redirect_stdout=False, redirect_stderr=False) as bar:
        task = bar.add_task(what, total=1.0, words="")
        yield lambda done, words: bar.update(task, completed=done, words=words)
