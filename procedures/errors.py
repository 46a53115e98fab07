"""What a person can mend in data, in what was asked of them, or in what is installed."""

from __future__ import annotations


class DataError(Exception):
    """The message says what is wrong, where, and what to do next. It ends a command with the exit code of usage."""


class BrokenKind(Exception):
    """A kind of calibration of an installed package cannot be used; ends a command as a bad configuration does."""
