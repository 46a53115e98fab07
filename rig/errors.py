"""Errors a person can act on, each with the exit code the command line ends with.

Exit codes: 0 done; 1 fault, bench safe; 2 usage; 3 done but outside acceptance; 4 stopped by `rig stop`; 5 fault, and
the bench could not be brought to its safe state; 6 still running (`rig status --check`); 75 interrupted, resumable;
78 bad configuration.
"""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """What the command line ends with; `docs/exit-codes.md` explains each."""

    DONE = 0
    FAULT = 1
    USAGE = 2
    OUTSIDE_ACCEPTANCE = 3
    STOPPED = 4
    UNSAFE = 5
    RUNNING = 6
    INTERRUPTED = 75
    CONFIGURATION = 78


class RigError(Exception):
    """Base of all errors shown to the user as one message, without a traceback."""

    exit_code = ExitCode.FAULT


class UsageError(RigError):
    """The command was asked for something it cannot do: a missing file, data of the wrong kind."""

    exit_code = ExitCode.USAGE


class ConfigurationError(RigError):
    """A bench, world or procedure file that cannot be used as it stands."""

    exit_code = ExitCode.CONFIGURATION


class BenchFault(RigError):
    """The bench cannot do what the procedure needs; it has been brought to its safe state."""


class BusyError(UsageError):
    """Another controller is using this bench or run file; nothing was touched."""


class RunFileError(RigError):
    """The run file cannot be used: not one, damaged or edited. The message says what can be saved."""


class StorageError(RigError):
    """A record could not be made durable (disk full, failed fsync): the run must stop, nothing is lost."""
