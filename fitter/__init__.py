"""Statistics for data of any laboratory: least squares, split plots, analysis of variance, parts of a trace.

Pure functions: arrays in, frozen dataclasses out. No files, no clocks, no instruments. Code of one kind of calibration
is in that kind's folder (`procedures`).
"""

from rig.fitter import lean_scipy  # noqa: F401 - before anything else imports SciPy
from rig.fitter.linear import LinearFit, RankError, Triangle, least_squares

__all__ = ["LinearFit", "RankError", "Triangle", "least_squares"]
