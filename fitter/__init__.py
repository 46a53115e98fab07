"""What data of any laboratory say: least squares, split plots, analysis of variance, what a trace is made of.

Pure functions: arrays in, frozen dataclasses out. No files, no clocks, no instruments. What only one kind of
calibration knows is in that kind's folder (`procedures`).
"""

from fitter.linear import LinearFit, RankError, Triangle, least_squares

__all__ = ["LinearFit", "RankError", "Triangle", "least_squares"]
