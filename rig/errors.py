"""Errors that a person can act on, each with an exit code of the command line.

Exit codes: 0 done; 1 fault, bench safe; 2 usage; 3 done but outside acceptance; 4 stopped by `rig stop`; 5 fault, and
the bench could not be brought to its safe state; 6 still running (`rig status --check`); 75 interrupted, resumable; 78
bad configuration.
"""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit code of the command line.

    Attributes:
        meaning: what a code says.
        next: what to do then. `rig explain exit-codes` prints both.
    """

    meaning: str
    next: str

    def __new__(cls, value: int, meaning: str, next: str) -> ExitCode:  # noqa: A002 - what to do next
        """A code with its meaning and what to do."""
        code = int.__new__(cls, value)
        code._value_, code.meaning, code.next = value, meaning, next
        return code

    DONE = 0, "done", ""
    FAULT = (
        1,
        "fault: an instrument, the disk or a damaged run file; the bench is in its safe state",
        "read the message; correct the cause; `rig resume RUN`",
    )
    USAGE = (
        2,
        "usage: an option, a file or a table that cannot be used, or a bench or run in use by another controller",
        "the message names file, row, column and permitted values; nothing was changed",
    )
    OUTSIDE_ACCEPTANCE = (
        3,
        "done, but outside the acceptance limits of the procedure; or more than a tenth of the points were lost; "
        "`rig fit --tolerance`: an inferred value is less certain; `rig confirm`: several explanations remain, or "
        "none, or the further run cannot show the effect; `rig loop`: the same, or a further run ended by a fault",
        "the run is complete and valid; see `rig trace RUN --report`, for lost points `rig status RUN`",
    )
    STOPPED = 4, "stopped by `rig stop`, parked", "`rig resume RUN` when ready"
    UNSAFE = (
        5,
        "fault, and the safe state of some instrument was NOT reached or not confirmed by its readback",
        "check the bench on site; then as for 1",
    )
    RUNNING = (
        6,
        "`rig status --check` only: a controller is running on it, or holding",
        "wait, or `rig hold`, `rig release`, `rig stop`",
    )
    INTERRUPTED = (
        75,
        "`rig run`, `rig resume`: interrupted (SIGINT, SIGTERM, SIGHUP of a closed terminal), motion stopped, nothing "
        "lost, outputs as declared by [`[safety] on_stop`](files.md#safety); or nobody did a step by hand in time, "
        "parked",
        "`rig resume RUN`",
    )
    CONFIGURATION = (
        78,
        "bad configuration: bench, procedure or world file",
        "the message names the place; nothing has moved",
    )


class RigError(Exception):
    """Base of all errors that are shown to the user as one message, without a traceback."""

    exit_code = ExitCode.FAULT


class UsageError(RigError):
    """The command cannot do what was asked: a missing file, data of the wrong kind."""

    exit_code = ExitCode.USAGE


class ConfigurationError(RigError):
    """A bench, world or procedure file that cannot be used unchanged."""

    exit_code = ExitCode.CONFIGURATION


class BenchFault(RigError):
    """The bench cannot do what the procedure requires; it has been brought to its safe state."""


class NotSafe(RigError):
    """An unforeseen error, its cause, after which some instruments could not be brought to their safe state."""

    exit_code = ExitCode.UNSAFE


class BusyError(UsageError):
    """Another controller is using this bench or run file; nothing was touched."""


class RunFileError(RigError):
    """The run file cannot be used: it is not a run file, damaged or edited. The message says what can be saved."""


class StorageError(RigError):
    """A record could not be made durable (disk full, failed fsync): the run must stop; no record is lost."""
