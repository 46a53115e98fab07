"""Coverage of expanded uncertainties, in words: with which probability, and where their factors are from."""

from __future__ import annotations

from collections.abc import Sequence

from rig.fitter.budget import Budgeted, coverage_factor

ROUNDED = 0.005
"""Coverage factors that are nearer to each other are printed alike."""


def headed(budgets: Sequence[Budgeted]) -> str:
    """The coverage probability of these budgets, and the distribution of their coverage factors, in words."""
    factors = [(one, coverage_factor(one.coverage_probability, one.df)) for one in budgets]
    other = any(abs(one.coverage_factor - t) > ROUNDED for one, t in factors)
    named = ", or of the distribution that a note names" if other else ""
    return f"{with_probability(budgets)}; k is of Student's t at the effective degrees of freedom{named}"


def with_probability(budgets: Sequence[Budgeted]) -> str:
    """The coverage probability of these budgets, in words."""
    return f"expanded uncertainties with a coverage probability of {100 * budgets[0].coverage_probability:g} %"
