"""Curves that are not linear in their parameters, and errors in the abscissa: problems and their least squares."""

from fitter.nonlinear.curve import ByStep, Curve, WrittenCurve
from fitter.nonlinear.lowest import solve_lowest
from fitter.nonlinear.problems import Correlated, Distance, Problem, Weighted
from fitter.nonlinear.solve import Solved, solve

__all__ = [
    "ByStep",
    "Correlated",
    "Curve",
    "Distance",
    "Problem",
    "Solved",
    "Weighted",
    "WrittenCurve",
    "solve",
    "solve_lowest",
]
