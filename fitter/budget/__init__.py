"""Uncertainty budgets after the GUM: JCGM 100, and JCGM 101 as a check."""

from fitter.budget.budget import Budgeted, Contribution, budgets, covariance
from fitter.budget.coverage import coverage_factor
from fitter.budget.influence import Correlation, Influence, TypeA
from fitter.budget.mass import Combined, combine

__all__ = [
    "Budgeted",
    "Combined",
    "Contribution",
    "Correlation",
    "Influence",
    "TypeA",
    "budgets",
    "combine",
    "covariance",
    "coverage_factor",
]
