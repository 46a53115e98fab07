"""Uncertainty budgets after the GUM: JCGM 100, and JCGM 101 as a check."""

from rig.fitter.budget.budget import Budgeted, Contribution, Shapes, budgets, covariance
from rig.fitter.budget.coverage import EXCESS, NEAR_95, coverage_factor, shape_factor
from rig.fitter.budget.influence import Correlation, Influence, TypeA
from rig.fitter.budget.many_rows import Combined, combine
from rig.fitter.budget.monte_carlo import Check, Interval, Simulated, check, monte_carlo, simulate
from rig.fitter.rounding import Rounded, rounded, rounded_df, rounded_factor, rounded_uncertainty

__all__ = [
    "EXCESS",
    "NEAR_95",
    "Budgeted",
    "Check",
    "Combined",
    "Contribution",
    "Correlation",
    "Influence",
    "Interval",
    "Rounded",
    "Shapes",
    "Simulated",
    "TypeA",
    "budgets",
    "check",
    "combine",
    "covariance",
    "coverage_factor",
    "monte_carlo",
    "rounded",
    "rounded_df",
    "rounded_factor",
    "rounded_uncertainty",
    "shape_factor",
    "simulate",
]
