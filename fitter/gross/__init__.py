"""Gross errors: readings that the scatter of the others does not explain. One method for all kinds of data."""

from fitter.gross.repeats import with_repeats
from fitter.gross.search import LEVEL, GrossErrors, gross_errors
from fitter.gross.together import without_smooth

__all__ = ["LEVEL", "GrossErrors", "gross_errors", "with_repeats", "without_smooth"]
