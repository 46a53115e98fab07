"""Decisions on conformity after JCGM 106 and ILAC-G8."""

from rig.fitter.decision.probability import Prior, conformity_probability, gamma_prior, normal_prior
from rig.fitter.decision.risk import Risks, global_risks, guard_band_for
from rig.fitter.decision.rules import (
    Decision,
    GuardBand,
    ProbabilityLimit,
    Rule,
    SharedRisk,
    SimpleAcceptance,
    Word,
    decide,
    guard_factor,
)
from rig.fitter.decision.tolerance import Tolerance

__all__ = [
    "Decision",
    "GuardBand",
    "Prior",
    "ProbabilityLimit",
    "Risks",
    "Rule",
    "SharedRisk",
    "SimpleAcceptance",
    "Tolerance",
    "Word",
    "conformity_probability",
    "decide",
    "gamma_prior",
    "global_risks",
    "guard_band_for",
    "guard_factor",
    "normal_prior",
]
