"""Gross errors: readings that the scatter of the others does not explain. One method for all kinds of data."""

from rig.fitter.gross.at_repeats import with_repeats
from rig.fitter.gross.forward_search import LEVEL, GrossErrors, gross_errors
from rig.fitter.gross.neighbours import without_smooth

__all__ = ["LEVEL", "GrossErrors", "gross_errors", "with_repeats", "without_smooth"]
