"""`rig run`: a procedure carried out on a bench, dry by default."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from rig.engine.session import Outcome, Progress, Signals
from rig.runs.controller import Result as Ended
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.verbs.data.result import Data
from rig.verbs.result import Plots, Result
from rig.verbs.run.status import status_of
from rig.who import operator as operator_of

if TYPE_CHECKING:
    from rig.procedures.present.blocks import Block
    from rig.verbs.frames import Frame


class Run(Result):
    """Result of a session of a run.

    Attributes:
        path: the run file.
        outcome: "complete", "stopped", "interrupted", "fault" or "unsafe".
        message: the reason, "" if none is needed.
        head: hash of the run file's last record; kept elsewhere, it shows later changes of the file.

    Example:
        >>> done = rig.run("procedure.toml", "bench.toml", world="world.toml")
        >>> done.complete, len(done.data.table)
        (True, 12)
    """

    def __init__(self, ended: Ended) -> None:
        self.path = ended.path
        self.outcome = ended.outcome.value
        self.message = ended.message
        self.head = ended.head

    @property
    def complete(self) -> bool:
        """Whether every point was observed or skipped finally."""
        return self.outcome == Outcome.COMPLETE.value

    @cached_property
    def data(self) -> Data:
        """Its observations, for fit and trace. Raises `RunFileError`."""
        return Data(self.path)

    @property
    def _told(self) -> Mapping[str, Any]:
        """The JSON of `rig status RUN --json`."""
        return status_of(self.path).told

    def blocks(self) -> Iterable[Block]:
        """The lines of `rig status RUN`."""
        return status_of(self.path).blocks()

    def notes(self) -> tuple[str, ...]:
        """Reason of the end, if there is one."""
        return (self.message,) if self.message else ()

    def frame(self) -> Frame:
        """Its observations."""
        return self.data.table.frame()

    def plot(self) -> Plots:
        """Its observations."""
        return self.data.table.plot()

    def __repr__(self) -> str:
        return f"<rig.Run {self.path}: {self.outcome}>"


def run(
    procedure: str | Path,
    bench: str | Path,
    *,
    dry: bool = True,
    world: str | Path | None = None,
    out: str | Path = "runs",
    operator: str | None = None,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> Run:
    """Carry out a procedure on a bench, to its end or an interrupt.

    An interrupt from the keyboard stops motion and leaves the run resumable: `rig resume`. There is no log, no
    notification, and no supervision of instruments after the end of this process: for an unattended run, use `rig run`.

    Args:
        procedure: the procedure file.
        bench: the bench file.
        dry: replace the real instruments by simulated ones.
        world: the world file of the simulated bench.
        out: folder of the run file.
        operator: name of the operator; None for RIG_OPERATOR or the login name.
        on_progress: called with the progress at every change of state, and about once a second of bench time.

    Raises:
        ConfigurationError: a file is wrong.
        BenchFault: an instrument cannot be reached.
        BusyError: another controller has one of the addresses.

    Example:
        >>> rig.run("procedure.toml", "bench.toml", world="world.toml").outcome
        'complete'
    """
    plan = load_plan(Path(procedure), Path(bench), dry=dry, world=None if world is None else Path(world))
    by = operator_of(operator)
    with _interruptible() as signals:
        ended = start_run(plan, Path(out), signals=signals, announce=lambda _: None, on_progress=on_progress, by=by)
    return Run(ended)


@contextmanager
def _interruptible() -> Iterator[Signals]:
    """Signals set by SIGINT, if this is the main thread; afterwards SIGINT has its earlier effect."""
    signals = Signals()
    if threading.current_thread() is not threading.main_thread():
        yield signals
        return

    def note(number: int, _frame: FrameType | None) -> None:
        signals.interrupt = signal.Signals(number).name

    before = signal.getsignal(signal.SIGINT)
    if before is not signal.SIG_IGN:  # a shell's background command ignores it
        signal.signal(signal.SIGINT, note)
    try:
        yield signals
    finally:
        signal.signal(signal.SIGINT, before)
