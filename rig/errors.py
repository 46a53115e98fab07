"""Errors that a person can act on, each with an exit code of the command line.

Exit codes: 0 done; 1 fault, bench safe; 2 usage; 3 done but outside acceptance; 4 stopped by `rig stop`; 5 fault, and
the bench could not be brought to its safe state; 6 still running (`rig status --check`); 75 interrupted, resumable; 78
bad configuration.
"""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit code of the command line; `docs/reference/exit_codes.md` explains each."""

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
