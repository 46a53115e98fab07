"""The error of the fitter that a person can mend: other data, another model, another file."""

from __future__ import annotations


class FitError(ValueError):
    """What was asked cannot be computed from what was given; the message says why and, where it can, what would help.

    An array of the wrong shape is no such thing: that is a mistake of the program, and stays a ValueError.
    """
