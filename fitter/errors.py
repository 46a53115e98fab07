"""The error of the fitter that a person can correct: other data, another model, another file."""

from __future__ import annotations


class FitError(ValueError):
    """The request cannot be computed from the given data; the message gives the reason and, if known, a remedy.

    An array of a wrong shape is an error of the program, and stays a ValueError.
    """
