"""Curves that are not linear in their parameters, and errors in the abscissa: problems and their least squares."""

from rig.fitter.nonlinear.curve import ByStep, Curve, WrittenCurve
from rig.fitter.nonlinear.lowest import solve_lowest
from rig.fitter.nonlinear.problems import Correlated, Distance, Problem, Weighted
from rig.fitter.nonlinear.solve import Solved, solve

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
