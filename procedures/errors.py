"""What a person can mend in data, or in what was asked of them."""

from __future__ import annotations


class DataError(Exception):
    """The message says what is wrong, where, and what to do next. It ends a command with the exit code of usage."""
