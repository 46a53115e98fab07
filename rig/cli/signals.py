"""Signals that end a session of a run."""

from __future__ import annotations

import signal
from types import FrameType

from rig.engine.session import Signals


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
