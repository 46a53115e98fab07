"""Propagation of distributions by Monte Carlo, and the check of a budget with it (JCGM 101, clauses 7 and 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget.budget import Budgeted
from rig.fitter.budget.draws import Evaluate, Trials, trials
from rig.fitter.budget.influence import Correlation, Influence, TypeA, checked
from rig.fitter.errors import FitError
from rig.fitter.rounding import rounded_uncertainty

BLOCK = 10_000
FINER = 5.0
"""The numerical tolerance of a budget's check is so many times that of the simulation (JCGM 101, 8.2)."""
FEWEST = 10
"""Blocks from which the scatter between blocks is known well enough to stop."""
MOST = 1_000_000


@dataclass(frozen=True)
class Interval:
    """A coverage interval.

    Attributes:
        lower: end.
        upper: end.

    """

    lower: float
    upper: float


@dataclass(frozen=True)
class Simulated:
    """Distribution of one result by simulation.

    Attributes:
        mean: of all trials.
        standard_deviation: of all trials. With Student's t among the inputs it is more than the standard uncertainty
            of a budget.
        symmetric: coverage interval with equal probabilities on both sides.
        shortest: coverage interval.
        probability: of both intervals.
        trials: number.
        error: twice the standard deviation of the least certain of mean, standard deviation and ends of the
            symmetric interval: from the scatter between blocks of trials (JCGM 101, 7.9.4), or, with a given number of
            trials, from their order statistics.
        stable: whether this error is within the numerical tolerance that was asked for.

    """

    mean: float
    standard_deviation: float
    symmetric: Interval
    shortest: Interval
    probability: float
    trials: int
    error: float
    stable: bool


@dataclass(frozen=True)
class Check:
    """A budget beside a simulation of the same inputs (JCGM 101, 8.1).

    Attributes:
        simulated: the distribution.
        tolerance: half a unit of the last digit of the standard uncertainty.
        lower: budget's interval minus simulated one, at the lower end.
        upper: the same at the upper end.
        agrees: whether both differences are within the tolerance; None if the simulation has too few trials to tell.

    """

    simulated: Simulated
    tolerance: float
    lower: float
    upper: float
    agrees: bool | None


def monte_carlo(
    budgeted: Sequence[Budgeted],
    type_a: TypeA | Sequence[TypeA],
    influences: Sequence[Influence],
    *,
    seed: int,
    evaluate: Evaluate | None = None,
    correlations: Sequence[Correlation] | None = None,
    digits: int = 2,
    count: int | None = None,
    most: int = MOST,
) -> tuple[Check, ...]:
    """Check budgets by simulation.

    Args:
        budgeted: budgets of m results.
        type_a: as in `budgets`.
        influences: as in `budgets`; their order is that of the errors.
        seed: of the random numbers; the same seed gives the same numbers.
        evaluate: whole evaluation, from (n, p) errors in standard uncertainties to (n, m) results, without
            repeatability; without it, results are linear in errors.
        correlations: as in `budgets`.
        digits: significant digits of a standard uncertainty that shall be confirmed.
        count: trials; without it, as many as are needed, and not more than `most`.
        most: trials. They take 8 m bytes each.

    Raises:
        FitError: what `budgets` refuses; correlated influences that are not normal; too few trials.

    """
    names, values = [one.name for one in budgeted], np.array([one.value for one in budgeted])
    inputs = checked(names, values, type_a, influences, correlations)
    probability = budgeted[0].coverage_probability if budgeted else 0.95
    found = simulate(
        trials(inputs, evaluate), seed=seed, probability=probability, digits=digits, count=count, most=most, finer=FINER
    )
    return tuple(check(one, simulated, digits) for one, simulated in zip(budgeted, found, strict=True))


def check(one: Budgeted, simulated: Simulated, digits: int = 2) -> Check:
    """One budget beside the probabilistically symmetric interval of a simulation."""
    lower = one.value - one.expanded_uncertainty - simulated.symmetric.lower
    upper = one.value + one.expanded_uncertainty - simulated.symmetric.upper
    tolerance = numerical_tolerance(one.standard_uncertainty, digits)
    farthest = max(abs(lower), abs(upper))
    agrees = None if abs(farthest - tolerance) < simulated.error else farthest <= tolerance
    return Check(simulated, tolerance, lower, upper, agrees)


def numerical_tolerance(standard_uncertainty: float, digits: int) -> float:
    """Half a unit of the last significant digit (JCGM 101, 7.9.2); 0 for an uncertainty of 0."""
    if standard_uncertainty == 0.0:
        return 0.0
    exponent = rounded_uncertainty(standard_uncertainty, digits).as_tuple().exponent
    return float(f"0.5e{exponent}")


def simulate(
    draw: Trials,
    *,
    seed: int,
    probability: float = 0.95,
    digits: int = 2,
    count: int | None = None,
    most: int = MOST,
    finer: float = 1.0,
) -> tuple[Simulated, ...]:
    """Distributions of m results, by the adaptive procedure of JCGM 101, 7.9.4.

    Blocks of trials are added until mean, standard deviation and both ends of the symmetric interval of every result
    are known within its numerical tolerance.

    Args:
        draw: trials.
        seed: of the random numbers.
        probability: coverage probability.
        digits: significant digits of the standard deviations that shall be right.
        count: trials instead; at least 100 / (1 - probability).
        most: trials.
        finer: the tolerance is divided by it.

    Raises:
        FitError: the probability is not between 0 and 1, a result is not finite, or there are too few trials.

    """
    if not 0.0 < probability < 1.0:
        raise FitError(f"a coverage probability of {probability:g}: it must be between 0 and 1")
    rng, least = np.random.default_rng(seed), round(100.0 / (1.0 - probability))
    if count is not None:
        if count < least:
            raise FitError(f"{count} trials are too few for {100.0 * probability:g} %: at least {least} are needed")
        sizes = [BLOCK] * (count // BLOCK) + ([count % BLOCK] if count % BLOCK else [])
        ordered = np.sort(np.concatenate([_finite(draw(rng, size)) for size in sizes]), axis=0)
        error = _error(ordered, probability)
        return _all(ordered, probability, error, _tolerances(ordered.std(axis=0, ddof=1), digits) / finer)
    size = max(least, BLOCK)
    blocks: list[FloatArray] = []
    figures: list[FloatArray] = []
    while True:
        blocks.append(_finite(draw(rng, size)))
        figures.append(_figures(np.sort(blocks[-1], axis=0), probability))
        if len(blocks) < FEWEST:
            continue
        each, h = np.array(figures), len(figures)
        error = np.max(2.0 * np.std(each, axis=0, ddof=1) / np.sqrt(h), axis=0)
        spread = np.sqrt(np.mean(np.square(each[:, 1]), axis=0) + np.var(each[:, 0], axis=0))
        tolerance = _tolerances(spread, digits) / finer
        if np.all(error <= tolerance) or (h + 1) * size > most:
            return _all(np.sort(np.concatenate(blocks), axis=0), probability, error, tolerance)


def _finite(values: FloatArray) -> FloatArray:
    if not np.all(np.isfinite(values)):
        raise FitError("a trial of the simulation gave a result that is not finite")
    return values


def _tolerances(spread: FloatArray, digits: int) -> FloatArray:
    return np.array([numerical_tolerance(float(one), digits) for one in spread])


def _error(ordered: FloatArray, probability: float) -> FloatArray:
    """(m,) twice the standard deviation of the least certain figure of sorted trials.

    A quantile lies between the order statistics at its rank plus and minus two binomial standard deviations.
    """
    count = len(ordered)
    centred = ordered - ordered.mean(axis=0)
    variance = np.mean(np.square(centred), axis=0)
    fourth = np.mean(np.square(np.square(centred)), axis=0)
    errors = [2.0 * np.sqrt(variance / count)]
    with np.errstate(divide="ignore", invalid="ignore"):
        errors.append(np.nan_to_num(np.sqrt(np.maximum(fourth / variance - variance, 0.0) / count)))
    for tail in (0.5 * (1.0 - probability), 0.5 * (1.0 + probability)):
        reach = 2.0 * np.sqrt(count * tail * (1.0 - tail))
        low, high = (int(np.clip(round(count * tail + sign * reach), 0, count - 1)) for sign in (-1, 1))
        errors.append(0.5 * (ordered[high] - ordered[low]))
    return np.asarray(np.max(errors, axis=0))


def _all(ordered: FloatArray, probability: float, error: FloatArray, tolerance: FloatArray) -> tuple[Simulated, ...]:
    return tuple(
        _simulated(ordered[:, j], probability, float(error[j]), bool(error[j] <= tolerance[j]))
        for j in range(ordered.shape[1])
    )


def _simulated(ordered: FloatArray, probability: float, error: float, stable: bool) -> Simulated:
    mean, sd, lower, upper = _figures(ordered[:, None], probability)[:, 0].tolist()
    return Simulated(
        mean, sd, Interval(lower, upper), shortest(ordered, probability), probability, len(ordered), error, stable
    )


def shortest(ordered: FloatArray, probability: float) -> Interval:
    """Shortest interval that holds a share of sorted values (JCGM 101, 7.7.4)."""
    inside = int(probability * len(ordered) + 0.5)
    widths = ordered[inside:] - ordered[: len(ordered) - inside]
    r = int(np.argmin(widths))
    return Interval(float(ordered[r]), float(ordered[r + inside]))


def _figures(ordered: FloatArray, probability: float) -> FloatArray:
    """(4, m) mean, standard deviation and ends of the symmetric interval of sorted trials (JCGM 101, 7.6 and 7.7.2)."""
    count = len(ordered)
    inside = int(probability * count + 0.5)
    r = (count - inside + 1) // 2
    ends = ordered[max(r - 1, 0)], ordered[min(r - 1 + inside, count - 1)]
    return np.stack([np.mean(ordered, axis=0), np.std(ordered, axis=0, ddof=1), *ends])
