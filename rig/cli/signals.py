"""Signals that end a session of a run."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from types import FrameType
from typing import Annotated

import typer

from rig.engine.session import Progress, Signals

KillOption = Annotated[
    int | None,
    typer.Option(
        "--kill-at-point",
        min=1,
        help="to test recovery: kill this process with SIGKILL after this many points",
        show_default=False,
    ),
]


def signals() -> Signals:
    """SIGINT, SIGTERM and SIGHUP (a lost terminal) stop motion and leave the run resumable.

    SIGINT and SIGHUP stay ignored if they were ignored when this process began.
    """
    signals = Signals()

    def note(number: int, _frame: FrameType | None) -> None:
        signals.interrupt = signal.Signals(number).name

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # nohup, and shells that start a command in the background, ask for these to be ignored
        if number == signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, note)
    return signals


def killing(show: Callable[[Progress], None], at_point: int | None) -> Callable[[Progress], None]:
    """The function for progress, which kills this process with SIGKILL at this number of points; None for never."""
    if at_point is None:
        return show

    def show_or_die(news: Progress) -> None:
        if news.done >= at_point:
            os.kill(os.getpid(), signal.SIGKILL)
        show(news)

    return show_or_die
