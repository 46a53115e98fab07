"""Errors that a person can correct: in data, in a request, or in installed packages."""

from __future__ import annotations


class DataError(Exception):
    """The message gives the defect, its place, and the next step. It ends a command with the exit code of usage."""


class BrokenKind(Exception):
    """A kind of calibration of an installed package cannot be used; the exit code is that of a bad configuration."""
