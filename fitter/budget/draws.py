"""Random errors of the inputs of a budget, for Monte Carlo simulation (JCGM 101, clause 6)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.budget.influence import Influence, Inputs, TypeA
from rig.fitter.errors import FitError

Evaluate = Callable[[FloatArray], FloatArray]
"""The whole evaluation: (n, p) errors of the influences, in their standard uncertainties, to (n, m) results."""
Trials = Callable[[np.random.Generator, int], FloatArray]
"""(n, m) results of n trials."""


def trials(inputs: Inputs, evaluate: Evaluate | None = None) -> Trials:
    """Trials of all results of a budget.

    Errors by repeated observations are added to the results: multivariate normal, or Student's t with the degrees of
    freedom of each result.

    Args:
        inputs: of the budget.
        evaluate: from errors to results; without it, results are linear in errors.

    Raises:
        FitError: correlated influences are neither normal nor t.

    """
    for group in inputs.groups:
        bounded = [inputs.influences[i] for i in group if inputs.influences[i].distribution not in ("normal", "t")]
        if len(group) > 1 and bounded:
            raise FitError(
                f"influence {bounded[0].name} is {bounded[0].distribution} and correlated with another: a simulation "
                "needs normal ones. If they have one source, state one influence with all its sensitivities"
            )
    sides = [np.zeros(len(inputs.values)) if one.deviation is None else one.deviation for one in inputs.type_a]
    roots = [_root(one.covariance - np.outer(h, h)) for one, h in zip(inputs.type_a, sides, strict=True)]
    s = inputs.sensitivities

    def draw(rng: np.random.Generator, count: int) -> FloatArray:
        errors = standard_errors(inputs, rng, count)
        results = inputs.values + errors @ s if evaluate is None else evaluate(errors)
        if results.shape != (count, len(inputs.values)):
            raise ValueError(f"the evaluation gave {results.shape}, not {(count, len(inputs.values))}")
        for one, root, h in zip(inputs.type_a, roots, sides, strict=True):
            if h.any():
                results = results + rng.choice([-1.0, 1.0], count)[:, None] * h
            results = results + rng.standard_normal((count, root.shape[0])) @ root * _t_scale(one, rng, count)
        return results

    return draw


def standard_errors(inputs: Inputs, rng: np.random.Generator, count: int) -> FloatArray:
    """(count, p) errors of the influences, in their standard uncertainties."""
    errors = np.empty((count, len(inputs.influences)))
    for group in inputs.groups:
        which = list(group)
        if len(which) == 1:
            errors[:, which[0]] = standard_error(inputs.influences[which[0]], rng, count)
            continue
        normal = rng.standard_normal((count, len(which))) @ _root(inputs.correlation[np.ix_(which, which)])
        errors[:, which] = normal * _scale(inputs.influences[which[0]].df, rng, count)[:, None]
    return errors


def standard_error(one: Influence, rng: np.random.Generator, count: int) -> FloatArray:
    """(count,) errors of one influence, in its standard uncertainty.

    A normal one with finite degrees of freedom is Student's t (JCGM 101, 6.4.9). Degrees of freedom of a bounded
    distribution do not count here: its limits are taken as exact.
    """
    match one.distribution:
        case "normal" | "t":
            return rng.standard_normal(count) * _scale(one.df, rng, count)
        case "rectangular":
            return rng.uniform(-1.0, 1.0, count) * float(np.sqrt(3.0))
        case "triangular":
            return (rng.random(count) - rng.random(count)) * float(np.sqrt(6.0))
        case "arcsine":
            return np.asarray(np.sqrt(2.0) * np.sin(2.0 * np.pi * rng.random(count)))


def _scale(df: float, rng: np.random.Generator, count: int) -> FloatArray:
    """Factors that make Student's t from the normal distribution."""
    return np.ones(count) if np.isinf(df) else np.sqrt(df / rng.chisquare(df, count))


def _t_scale(one: TypeA, rng: np.random.Generator, count: int) -> FloatArray:
    """(count, m) such factors; those of one trial have the same probability for all results."""
    df = np.broadcast_to(one.df, (len(one.covariance),))
    share = rng.random(count)
    scale = np.ones((count, len(df)))
    for number in np.unique(df[np.isfinite(df)]):
        scale[:, df == number] = np.sqrt(number / (2.0 * special.gammaincinv(0.5 * number, share)))[:, None]
    return scale


def _root(covariance: FloatArray) -> FloatArray:
    """R with R' R = covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))).T)
