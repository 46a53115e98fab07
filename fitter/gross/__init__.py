"""Gross errors: readings that no scatter of the others explains. Found by one method in every kind of data."""

from fitter.gross.search import LEVEL, GrossErrors, gross_errors

__all__ = ["LEVEL", "GrossErrors", "gross_errors"]
